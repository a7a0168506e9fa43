/** Building small clouds by hand. */
import { shCoefficientCount, type GaussianCloud, type ShDegree, type Vector3 } from '@gaussian-splat/core';
import type { Quaternion } from './random.js';

/** First basis function of spherical harmonics: a constant, sqrt(1 / 4π). */
const SH_C0 = 0.28209479177387814;

export interface SplatDescription {
  readonly position: Vector3;
  /** Standard deviations along the local axes; one number for a ball. */
  readonly scale: Vector3 | number;
  /** Unit quaternion (w, x, y, z); default none. */
  readonly rotation?: Quaternion;
  readonly opacity: number;
  /** Red, green, blue as seen from everywhere, if `sh` has nothing to add; may leave 0..1. */
  readonly color: Vector3;
  /** Coefficients after the first, red, green and blue innermost; missing ones are 0. */
  readonly sh?: readonly number[];
}

/** A cloud of the described splats, in their order. */
export function cloudOf(
  splats: readonly SplatDescription[],
  shDegree: ShDegree = 0,
  origin: Vector3 = [0, 0, 0],
): GaussianCloud {
  const shLength = 3 * shCoefficientCount(shDegree);
  const flat = (size: number, values: (splat: SplatDescription) => readonly number[]): Float32Array => {
    const array = new Float32Array(size * splats.length);
    splats.forEach((splat, i) => array.set(values(splat).slice(0, size), size * i));
    return array;
  };
  return {
    count: splats.length,
    origin,
    positions: flat(3, (s) => s.position),
    scales: flat(3, (s) => (typeof s.scale === 'number' ? [s.scale, s.scale, s.scale] : s.scale)),
    rotations: flat(4, (s) => s.rotation ?? [1, 0, 0, 0]),
    opacities: flat(1, (s) => [s.opacity]),
    sh: flat(shLength, (s) => [...s.color.map((c) => (c - 0.5) / SH_C0), ...(s.sh ?? [])]),
    shDegree,
    antialiased: false,
    droppedCount: 0,
  };
}

/** `count` descriptions, each made by `describe`. */
export const repeat = (count: number, describe: (i: number) => SplatDescription): SplatDescription[] =>
  Array.from({ length: count }, (_, i) => describe(i));
