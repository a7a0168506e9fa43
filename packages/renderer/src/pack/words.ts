/** Sizes of packed scenes. Separate from the packing code, which few pages need on the main thread. */
import { shCoefficientCount, type ShDegree } from '@gaussian-splat/core';
import { layouts } from '../generated/shaders.js';

/** Number of 32-bit words of one splat's geometry. */
export const GEOMETRY_WORDS = layouts.PackedGaussian.size / 4;

/** Number of float32 of one chunk. */
export const CHUNK_NUMBERS = layouts.Chunk.size / 4;

/** Storage of the spherical harmonics of a scene: see `packSh`. */
export type ShPrecision = 'int8' | 'float16';

/** Value of `View.sh_encoding` for each precision. */
export const SH_PRECISION: Record<ShPrecision, number> = { int8: 0, float16: 1 };

/**
 * Returns the number of 32-bit words of one splat's spherical harmonics. For degree 0 to 3 these are 2, 4, 8, 14 as
 * `int8`, and 2, 6, 14, 24 as `float16`.
 */
export function shWords(degree: ShDegree, precision: ShPrecision): number {
  if (precision === 'float16') return 2 * Math.ceil((3 * shCoefficientCount(degree)) / 4);
  return [2, 4, 8, 14][degree];
}
