/** Content of one layer of OpenUSD, whether it was text or binary. */
import { quote } from '../bytes.js';
import { damaged } from '../faults.js';

/**
 * A value of an attribute or of metadata. Tuples and arrays of tuples are flattened: quaternions to (w, x, y, z),
 * matrices by rows. Arrays are Float32Array unless the type is of doubles.
 */
export type UsdValue = boolean | number | string | Float32Array | Float64Array | readonly string[];

/** Reads a value when it is needed, so that attributes that are not drawn cost nothing. Undefined: no value. */
export type LateValue = () => UsdValue | undefined;

export interface UsdAttribute {
  readonly value?: LateValue | undefined;
  /** Values by time code, ascending. */
  readonly samples?: readonly { readonly time: number; readonly value: LateValue }[] | undefined;
}

export interface UsdPrim {
  readonly name: string;
  /** Type of its schema, such as `Xform`; empty if it has none. */
  readonly type: string;
  readonly specifier: 'def' | 'over' | 'class';
  /** Undefined for a prim at the root. */
  readonly parent: UsdPrim | undefined;
  readonly attributes: Map<string, UsdAttribute>;
  readonly metadata: Map<string, UsdValue>;
  /** A composition arc of the prim, by its name of {@link ARCS}. */
  arc?: string | undefined;
}

export interface UsdLayer {
  /** All prims, each after its parent. */
  readonly prims: readonly UsdPrim[];
  readonly metadata: ReadonlyMap<string, UsdValue>;
  /** Composition arc of the layer itself. */
  readonly arc?: string | undefined;
}

/** Composition arcs, which bring content of other layers or prims, for people, by their names in text and in binary. */
export const ARCS: ReadonlyMap<string, string> = new Map([
  ['references', 'references'],
  ['payload', 'payloads'],
  ['inherits', 'inherits'],
  ['inheritPaths', 'inherits'],
  ['specializes', 'specializes'],
  ['variantSets', 'variant sets'],
  ['variantSetNames', 'variant sets'],
  ['subLayers', 'sublayers'],
  ['clips', 'value clips'],
  ['relocates', 'relocates'],
  ['layerRelocates', 'relocates'],
]);

/** Dictionary of a layer whose texts readers keep among its metadata, under their names after this prefix. */
export const LAYER_DATA = 'customLayerData';
export const DATA_PREFIX = `${LAYER_DATA}:`;

/** Metadata that readers of layers keep. */
export const KEPT_METADATA: ReadonlySet<string> = new Set([
  ...['upAxis', 'metersPerUnit', 'startTimeCode'],
  ...['active', 'apiSchemas'],
]);

/** Maximum nesting of prims. */
export const MAX_DEPTH = 500;
/** Bytes charged for each prim, and for each attribute or sample of one. */
export const [PRIM_BYTES, ATTRIBUTE_BYTES] = [1024, 256];

/** Path of a prim, for example `/World/Splats`. */
export function pathOf(prim: UsdPrim | undefined): string {
  const names: string[] = [];
  for (let at = prim; at; at = at.parent) names.unshift(at.name);
  return `/${names.join('/')}`;
}

/** Path of a prim for messages: at most 80 characters, and no unprintable ones. */
export const shownPath = (prim: UsdPrim | undefined): string => quote(pathOf(prim), 80).slice(1, -1);

/** Value of an attribute at a time code: its last sample until then, or the first one; otherwise its default. */
export function valueAt(attribute: UsdAttribute | undefined, time: number): UsdValue | undefined {
  const { samples } = attribute ?? {};
  if (!samples || samples.length === 0) return attribute?.value?.();
  return (samples.findLast((sample) => sample.time <= time) ?? samples[0]).value();
}

/** Throws `decode/corrupt`, or `decode/truncated` for a layer that ends early. */
export function fail(where: string, expected: string, found: string, isCut = false): never {
  throw damaged(where, expected, found, isCut ? 'decode/truncated' : 'decode/corrupt');
}
