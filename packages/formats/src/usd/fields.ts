import { shCoefficientCount, type ShDegree } from '@gaussian-splat/core';
import { grouped, quote } from '../bytes.js';
import { allocateCloud, keptDegree, type DraftCloud } from '../cloud.js';
import { damaged, DEGREE_4, FLAT, warn } from '../faults.js';
import type { SceneSource } from '../scene-format.js';
import { shownPath, valueAt, type UsdPrim } from './layer.js';

const SPLATS = 'ParticleField3DGaussianSplat';
/** Kernels that may be applied to a `ParticleField`. */
const [ELLIPSOID, SURFLET] = ['ParticleFieldKernelGaussianEllipsoidAPI', 'ParticleFieldKernelGaussianSurfletAPI'];
const HARMONICS = 'radiance:sphericalHarmonicsCoefficients';

/** Trained orders by the values of `sortingModeHint`. */
const ORDERS: ReadonlyMap<unknown, 'pixel' | 'distance' | undefined> = new Map([
  ['zDepth', undefined],
  ['cameraDistance', 'distance'],
  ['rayHitDistance', 'pixel'],
]);

/** Whether a prim is a field of Gaussians: 3D, or flat ones. */
export function isField({ type, metadata }: UsdPrim): boolean {
  if (type === SPLATS) return true;
  const schemas = metadata.get('apiSchemas');
  return (
    type === 'ParticleField' && Array.isArray(schemas) && [ELLIPSOID, SURFLET].some((name) => schemas.includes(name))
  );
}

/**
 * Reads the splats of a prim in its own coordinates, at a time code. As OpenUSD demands, an array that is too long is cut,
 * and one that is too short or missing is replaced by defaults: no rotation, a scale and an opacity of 1, gray.
 */
export function readField(prim: UsdPrim, time: number, source: SceneSource): DraftCloud {
  const { attributes } = prim;
  const where = `${source.name}, ${shownPath(prim)}`;
  const valueOf = (name: string): unknown => valueAt(attributes.get(name), time);
  /** Returns the numbers of the attribute with float or, without one, with half precision. */
  const numbersOf = (name: string): ArrayLike<number> | undefined => {
    const value = valueOf(name) ?? valueOf(`${name}h`);
    if (value === undefined || value instanceof Float32Array || value instanceof Float64Array) return value;
    throw damaged(`${where}.${name}`, 'an array of numbers', quote(String(value)));
  };
  const positions = numbersOf('positions') ?? [];
  const count = Math.floor(positions.length / 3);
  const degree = degreeOf(valueOf('radiance:sphericalHarmonicsDegree') ?? 3, where);
  const harmonics = numbersOf(HARMONICS);
  const stored = 3 * (degree + 1) ** 2;
  const hasHarmonics = harmonics !== undefined && harmonics.length >= stored * count;
  const cloud = allocateCloud(count, hasHarmonics ? keptDegree(degree) : 0, source);
  const own = 3 * shCoefficientCount(cloud.shDegree);
  /** Fills an array of the cloud, or leaves its defaults with a warning if the attribute is too short. */
  const fill = (name: string, to: Float32Array, defaults: readonly number[]): void => {
    const from = numbersOf(name);
    if (from && from.length >= to.length) put(from, to);
    else {
      for (let k = 0; k < to.length; k++) to[k] = defaults[k % defaults.length];
      if (from) warnShort(cloud, prim, name, from.length / defaults.length);
    }
  };
  put(positions, cloud.positions);
  fill('scales', cloud.scales, [1, 1, 1]);
  fill('orientations', cloud.rotations, [1, 0, 0, 0]);
  fill('opacities', cloud.opacities, [1]);
  if (!hasHarmonics) {
    if (harmonics) warnShort(cloud, prim, HARMONICS, harmonics.length / stored);
  } else if (own === stored) put(harmonics, cloud.sh);
  else for (let i = 0; i < count; i++) for (let k = 0; k < own; k++) cloud.sh[own * i + k] = harmonics[stored * i + k];
  if (hasHarmonics && degree === 4) warn(cloud, DEGREE_4);
  flatten(cloud, prim);
  readHints(cloud, prim, valueOf);
  return cloud;
}

function put(from: ArrayLike<number>, to: Float32Array): void {
  if (from instanceof Float32Array) to.set(from.length > to.length ? from.subarray(0, to.length) : from);
  else for (let k = 0; k < to.length; k++) to[k] = from[k];
}

function degreeOf(value: unknown, where: string): ShDegree | 4 {
  const degrees = [0, 1, 2, 3, 4] as const;
  const found = degrees.find((degree) => degree === value);
  if (found !== undefined) return found;
  throw damaged(
    `${where}, radiance:sphericalHarmonicsDegree`,
    'a degree from 0 to 4',
    quote(String(value)),
    'decode/unsupported',
  );
}

function warnShort(cloud: DraftCloud, prim: UsdPrim, name: string, found: number): void {
  const counts = `${grouped(Math.floor(found))} of ${grouped(cloud.count)}`;
  warn(cloud, `${shownPath(prim)}: ${name} has values for ${counts} splats, and is ignored, as OpenUSD demands.`);
}

/** Makes the splats of a flat kernel discs in their xy plane. */
function flatten(cloud: DraftCloud, { type, metadata }: UsdPrim): void {
  const schemas = metadata.get('apiSchemas');
  if (cloud.count === 0 || type === SPLATS || !Array.isArray(schemas) || schemas.includes(ELLIPSOID)) return;
  for (let k = 2; k < cloud.scales.length; k += 3) cloud.scales[k] = 0;
  warn(cloud, FLAT);
}

function readHints(cloud: DraftCloud, prim: UsdPrim, valueOf: (name: string) => unknown): void {
  const hints = {
    sortingModeHint: valueOf('sortingModeHint') ?? 'zDepth',
    projectionModeHint: valueOf('projectionModeHint') ?? 'perspective',
  };
  const order = ORDERS.get(hints.sortingModeHint);
  if (order) cloud.hints = { order };
  const unknown = (name: keyof typeof hints, drawn: string): void =>
    warn(
      cloud,
      `The ${name} ${quote(String(hints[name]))} of ${shownPath(prim)} is not known; "${drawn}" is drawn in its place.`,
    );
  if (!ORDERS.has(hints.sortingModeHint)) unknown('sortingModeHint', 'zDepth');
  if (hints.projectionModeHint !== 'perspective') unknown('projectionModeHint', 'perspective');
}
