import { shCoefficientCount, type GaussianCloud, type ShDegree } from '@gaussian-splat/core';
import type { Ranking, Scores } from './score.js';

/** What is taken from a scene. */
export interface Cut {
  /** Splats that contribute less than this to every pixel go; 0, the default, keeps all. */
  readonly minContribution?: number;
  /** Splats whose absence costs less than this mean squared error go; 0, the default, keeps all. */
  readonly removalPrice?: number;
  /** Mean squared error that a splat's coefficient is worth: those that save less go; 0, the default, keeps all. */
  readonly colourPrice?: number;
}

/** A cloud with its least needed parts gone. */
export interface ReducedCloud {
  /** From the most to the least seen: any beginning of it is a coarser picture of all. Coefficients above a splat's degree are 0. */
  readonly cloud: GaussianCloud;
  /** [N] degree that each splat keeps. */
  readonly degrees: Uint8Array;
}

/** Applies a cut. The source is left as it is. */
export function reduce(cloud: GaussianCloud, scores: Scores, cut: Cut): ReducedCloud {
  const kept = coarseToFine(cloud, scores, cut);
  const degrees = Uint8Array.from(kept, (i) => degreeOf(cloud.shDegree, scores, i, cut.colourPrice ?? 0));
  const highest = degrees.reduce((most, degree) => Math.max(most, degree), 0) as ShDegree;
  const reduced = {
    ...cloud,
    count: kept.length,
    positions: rowsOf(cloud.positions, 3, kept),
    scales: rowsOf(cloud.scales, 3, kept),
    rotations: rowsOf(cloud.rotations, 4, kept),
    opacities: rowsOf(cloud.opacities, 1, kept),
    sh: coloursOf(cloud, scores, kept, degrees, highest),
    shDegree: highest,
  };
  return { cloud: reduced, degrees };
}

/** Rows of so many numbers, in a new order. */
function rowsOf(values: Float32Array, width: number, kept: Uint32Array): Float32Array {
  const taken = new Float32Array(width * kept.length);
  for (let k = 0; k < kept.length; k++) {
    for (let column = 0; column < width; column++) taken[width * k + column] = values[width * kept[k] + column];
  }
  return taken;
}

/** The coefficients of the splats that stay, each at its degree, in rows as long as the highest needs. */
function coloursOf(
  { sh, shDegree }: GaussianCloud,
  { lowered }: Scores,
  kept: Uint32Array,
  degrees: Uint8Array,
  highest: ShDegree,
): Float32Array {
  const stride = 3 * shCoefficientCount(shDegree);
  const length = 3 * shCoefficientCount(highest);
  const colours = new Float32Array(length * kept.length);
  for (let k = 0; k < kept.length; k++) {
    const i = kept[k];
    if (degrees[k] < shDegree) colours.set(lowered[degrees[k]].of(i), length * k);
    else for (let number = 0; number < stride; number++) colours[length * k + number] = sh[stride * i + number];
  }
  return colours;
}

/**
 * Positive floats are in the order of their bits. Together with the splat's number they fit the 53 bits of a float64, if need be without their last ones, and numbers sort
 * many times faster than a comparison does.
 */
const [IMPORTANCE_BITS, KEY_BITS] = [31, 53];

/** Numbers of the splats that stay, the most seen first: by contribution times the area of the splat. */
function coarseToFine(
  { count, scales }: GaussianCloud,
  { contribution, removalError }: Ranking,
  cut: Cut,
): Uint32Array {
  const { minContribution = 0, removalPrice = 0 } = cut;
  const importance = new Float32Array(1);
  const bits = new Uint32Array(importance.buffer);
  const keys = new Float64Array(count);
  const placeBits = Math.max(1, Math.ceil(Math.log2(count)));
  const [places, unit] = [2 ** placeBits, 2 ** Math.max(0, placeBits + IMPORTANCE_BITS - KEY_BITS)];
  let length = 0;
  for (let i = 0; i < count; i++) {
    if (contribution[i] < minContribution || removalError[i] < removalPrice) continue;
    const [a, b, c] = [scales[3 * i], scales[3 * i + 1], scales[3 * i + 2]];
    importance[0] = contribution[i] * Math.max(a * b, b * c, c * a);
    keys[length++] = Math.floor((2 ** IMPORTANCE_BITS - bits[0]) / unit) * places + i;
  }
  const sorted = keys.subarray(0, length).sort();
  return Uint32Array.from(sorted, (key) => key % places);
}

/** The degree at which error and the price of what is kept add up to least. */
function degreeOf(full: ShDegree, { lowered }: Scores, i: number, price: number): ShDegree {
  let best = full;
  let least = price * shCoefficientCount(full);
  for (let degree = 0; degree < full; degree++) {
    const cost = lowered[degree].error[i] + price * shCoefficientCount(degree as ShDegree);
    if (cost > least || (cost === least && price === 0)) continue;
    [best, least] = [degree as ShDegree, cost];
  }
  return price > 0 ? best : full;
}

/** [4] splats of each degree. */
export function degreesOf(degrees: Uint8Array): number[] {
  const counts = [0, 0, 0, 0];
  for (const degree of degrees) counts[degree]++;
  return counts;
}

/** Coefficients above the constant one that a reduced cloud keeps, all splats and channels together. */
export function keptCoefficients(degrees: Uint8Array): number {
  return degrees.reduce((sum, degree) => sum + 3 * ((degree + 1) ** 2 - 1), 0);
}
