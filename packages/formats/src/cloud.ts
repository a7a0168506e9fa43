import { shCoefficientCount, type GaussianCloud, type ShDegree, type Vector3 } from '@gaussian-splat/core';
import type { SceneSource } from './scene-format.js';

/** Value of the constant spherical harmonic, 1/(2·sqrt(pi)): color = 0.5 + SH_C0·f_dc. */
export const SH_C0 = 0.28209479177387814;

/** A cloud that a reader is still filling: its properties are writable. */
export type DraftCloud = {
  -readonly [K in keyof GaussianCloud]: GaussianCloud[K];
};

/**
 * Allocates a cloud whose arrays are filled with zeros, and charges it to the budget.
 * @throws GaussianSplatError `out-of-memory/budget`
 */
export function allocateCloud(
  count: number,
  shDegree: ShDegree,
  { budget, name }: Pick<SceneSource, 'budget' | 'name'>,
): DraftCloud {
  budget.takeSplats(count, shDegree, name);
  return {
    count,
    origin: [0, 0, 0] satisfies Vector3,
    positions: new Float32Array(3 * count),
    scales: new Float32Array(3 * count),
    rotations: new Float32Array(4 * count),
    opacities: new Float32Array(count),
    sh: new Float32Array(3 * shCoefficientCount(shDegree) * count),
    shDegree,
    antialiased: false,
    droppedCount: 0,
  };
}

/** Converts logits to opacities, 1/(1 + exp(-x)), in place. */
export function sigmoidInPlace(values: Float32Array): void {
  for (let i = 0; i < values.length; i++) values[i] = 1 / (1 + Math.exp(-values[i]));
}

/** Converts logarithms of standard deviations to standard deviations, in place. */
export function expInPlace(values: Float32Array): void {
  for (let i = 0; i < values.length; i++) values[i] = Math.exp(values[i]);
}

/** Degree of spherical harmonics, by the number of coefficients above the constant one in each color channel. */
export const DEGREE_OF_REST_COUNT: ReadonlyMap<number, ShDegree | 4> = new Map([
  [0, 0],
  [3, 1],
  [8, 2],
  [15, 3],
  [24, 4],
]);

/**
 * Returns the degree of the cloud for the degree of a file. Degree 4 is truncated to 3, the maximum of a cloud. Because
 * spherical harmonics are orthogonal, the remaining bands are the best approximation of degree 3.
 */
export function keptDegree(degree: ShDegree | 4): ShDegree {
  return degree === 4 ? 3 : degree;
}
