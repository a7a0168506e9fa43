import type { GaussianCloud } from '@gaussian-splat/core';
import type { AnimatedAttributeName } from '@gaussian-splat/formats';
import type { Steps } from '../steps.js';
import { mainCurves } from './main-curves.js';

/**
 * Quantization steps of motion: `position` in units of the scene, `rotation` in radians, `scale` in natural logarithms.
 * `opacity` and `color` (constant coefficients) have the units of these attributes.
 */
export type MotionSteps = Steps<AnimatedAttributeName>;

/** Fraction of a step below which the root mean square weight of a curve is too small to keep the curve. */
const MIN_CURVE = 0.12;

/** Principal curves of an attribute's numbers, strongest first. A row is a number of a splat over the frames. */
export interface Followed {
  /** Count of rows: numbers of the attribute times splats. */
  readonly rows: number;
  readonly frames: number;
  /** Values of each curve, [frames]. */
  readonly curves: readonly Float64Array[];
  /** For each curve, its weight for each row, [rows]. */
  readonly shares: readonly Float32Array[];
  /**
   * Number of the last curves that only splats have that are absent from some frames. The error of either kind of curves
   * is that of other splats.
   */
  readonly passing: number;
  /** Whether the curves of `passing` run in the age of a splat, from its first frame on. */
  readonly isAged: boolean;
}

/** Writes to `turn` the quaternion that rotates splat `i` to splat `j` of another cloud, to · from⁻¹. */
export function turnBetween(from: GaussianCloud, i: number, to: GaussianCloud, j: number, turn: Float64Array): void {
  const [p, q, at, end] = [from.rotations, to.rotations, 4 * i, 4 * j];
  const [w, x, y, z] = [p[at], -p[at + 1], -p[at + 2], -p[at + 3]];
  const [a, b, c, d] = [q[end], q[end + 1], q[end + 2], q[end + 3]];
  turn[0] = a * w - b * x - c * y - d * z;
  turn[1] = a * x + b * w + c * z - d * y;
  turn[2] = a * y - b * z + c * w + d * x;
  turn[3] = a * z + b * y - c * x + d * w;
}

/** Returns the minimum root mean square weight of a curve for a quantization step. */
export const minCurve = (step: number): number => MIN_CURVE * step;

/** Ratio of the current steps of motion to the finest ones, for which curves are found. */
export const FINER = 16;

/** Returns the typical step of the motion for whose finest steps {@link minCurve} returned `min`. */
export const minCurveStep = (min: number): number => (FINER * min) / MIN_CURVE;

/**
 * Returns the principal curves of rows, and their weights.
 * @param changes [rows, frames] differences.
 * @param min Minimum root mean square weight of a curve; see {@link minCurve}.
 */
export function followed(changes: Float32Array, frames: number, min: number): Followed {
  const curves = mainCurves(changes, frames, min);
  const shares = curves.map((curve) => sharesOf(changes, curve));
  return { rows: changes.length / frames, frames, curves, shares, passing: 0, isAged: false };
}

/** Returns the weight of a curve for each row, [rows]. @param changes [rows, frames] differences. */
export function sharesOf(changes: Float32Array, curve: Float64Array): Float32Array {
  const frames = curve.length;
  const shares = new Float32Array(changes.length / frames);
  for (let row = 0, at = 0; row < shares.length; row++) {
    let sum = 0;
    for (let f = 0; f < frames; f++) sum += changes[at++] * curve[f];
    shares[row] = sum / frames;
  }
  return shares;
}
