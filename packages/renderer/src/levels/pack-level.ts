import type { GaussianCloud } from '@gaussian-splat/core';
import { packShape } from '../pack/pack.js';
import { packSh } from '../pack/sh.js';
import { FACTOR_NUMBERS, type SplatLevel } from './splat-level.js';
import { GEOMETRY_WORDS, type ShPrecision } from '../pack/words.js';

/**
 * Writes the geometry words of splats `from` to `end` of a level (by default all) to `words`, from splat `first` on.
 */
export function packLevelGeometry(
  level: SplatLevel,
  words: Uint32Array,
  first: number,
  from = 0,
  end = level.count,
): void {
  const floats = new Float32Array(words.buffer, words.byteOffset, words.length);
  const factor = new Float64Array(FACTOR_NUMBERS);
  for (let i = from; i < end; i++) {
    const at = GEOMETRY_WORDS * (first + i - from);
    for (let axis = 0; axis < 3; axis++) floats[at + axis] = level.positions[3 * i + axis];
    for (let k = 0; k < FACTOR_NUMBERS; k++) factor[k] = level.factors[FACTOR_NUMBERS * i + k];
    packShape(words, at + 3, factor, level.opacities[i]);
  }
}

/** Writes invisible splats of opacity 0 at indices `first` to `end`, to fill the last chunk of a level. */
export function packFiller(words: Uint32Array, first: number, end: number): void {
  const factor = Float64Array.of(1e-6, 0, 1e-6, 0, 0, 1e-6);
  for (let i = first; i < end; i++) packShape(words, GEOMETRY_WORDS * i + 3, factor, 0);
}

/** Returns the packed spherical harmonics of splats `from` to `end` of a level, by default of all. */
export function packLevelSh(level: SplatLevel, precision: ShPrecision, from = 0, end = level.count): Uint32Array {
  const { sh, shDegree } = level;
  const order = level.shOrder?.subarray(from, end) ?? Uint32Array.from({ length: end - from }, (_, k) => from + k);
  return packSh({ sh, shDegree } as GaussianCloud, order, precision);
}
