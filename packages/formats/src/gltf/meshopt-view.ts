import { isObject } from '../json.js';
import type { Json } from './container.js';
import type { GltfDocument } from './document.js';

const MODES = ['ATTRIBUTES', 'TRIANGLES', 'INDICES'] as const;
const FILTERS = ['NONE', 'OCTAHEDRAL', 'QUATERNION', 'EXPONENTIAL', 'COLOR'] as const;
const MAX_STRIDE = 256;

/** Parameters of a buffer view that meshoptimizer has compressed. */
export interface MeshoptParameters {
  readonly count: number;
  /** Size of an uncompressed element in bytes, 1 to 256. */
  readonly stride: number;
  readonly mode: (typeof MODES)[number];
  readonly filter: (typeof FILTERS)[number];
}

/** Returns the properties of the compression by meshoptimizer of a buffer view; undefined if it is not compressed. */
export function packingOf({ extensions }: Json): Json | undefined {
  if (!isObject(extensions)) return undefined;
  const packed = extensions.EXT_meshopt_compression ?? extensions.KHR_meshopt_compression;
  return isObject(packed) ? packed : undefined;
}

/** Validates the properties of a compressed buffer view. @param path Path of the view in the JSON. */
export function meshoptParameters(document: GltfDocument, packed: Json, path: string): MeshoptParameters {
  const { count, byteStride, filter: givenFilter = 'NONE' } = packed;
  const mode = MODES.find((one) => one === packed.mode);
  const filter = FILTERS.find((one) => one === givenFilter);
  if (!mode || !filter)
    return document.fail(path, 'a mode and a filter of meshopt', { mode: packed.mode, filter: givenFilter });
  if (document.isIndex(count) && document.isIndex(byteStride) && byteStride >= 1 && byteStride <= MAX_STRIDE)
    return { count, stride: byteStride, mode, filter };
  return document.fail(path, 'a count and a stride of meshopt', { count, byteStride });
}
