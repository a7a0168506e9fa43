/** Sizes of packed scenes. Separate from the packing code, which few pages need on the main thread. */
import { shCoefficientCount, type ShDegree } from '@gaussian-splat/core';
import { layouts } from '../generated/shaders.js';

/** 32-bit words of one splat's geometry. */
export const GEOMETRY_WORDS = layouts.PackedGaussian.size / 4;

/** Numbers of one chunk. */
export const CHUNK_NUMBERS = layouts.Chunk.size / 4;

/** Storage of spherical harmonics: see `packSh`. */
export type ShPrecision = 'int8' | 'float16';

/** Values of `View.sh_encoding`. */
export const SH_PRECISION: Record<ShPrecision, number> = { int8: 0, float16: 1 };

/** 32-bit words of one splat's spherical harmonics: 2, 4, 8, 14 as `int8`, 2, 6, 14, 24 as `float16` for degree 0 to 3. */
export function shWords(degree: ShDegree, precision: ShPrecision): number {
  if (precision === 'float16') return 2 * Math.ceil((3 * shCoefficientCount(degree)) / 4);
  return [2, 4, 8, 14][degree];
}
