import { shCoefficientCount, type GaussianCloud, type ShDegree } from '@gaussian-splat/core';
import { ascendingOrder } from './order.js';
import type { Scores } from './score.js';

/** What is taken from a scene. */
export interface Cut {
  /** Splats that contribute less than this to every pixel go; 0, the default, keeps all. */
  readonly minContribution?: number;
  /** Splats whose absence costs less than this mean squared error go; 0, the default, keeps all. */
  readonly removalPrice?: number;
  /** Mean squared error that a splat's coefficient is worth: those that save less go; 0, the default, keeps all. */
  readonly colourPrice?: number;
  /** Pairs of splats that look like one at a mean squared error up to this become one, by evaluators that merge ({@link MergingEvaluator}); 0, the default, merges none. */
  readonly mergePrice?: number;
}

/** A cloud with its least needed parts gone. */
export interface ReducedCloud {
  /** From the most to the least seen: any beginning of it is a coarser picture of all. Coefficients above a splat's degree are 0. */
  readonly cloud: GaussianCloud;
  /** [N] degree that each splat keeps. */
  readonly degrees: Uint8Array;
  /** [N] its number in the source; of a merged splat that of one that it was made of. */
  readonly kept: Uint32Array;
}

/** Which splats stay, and how much of their colours. */
export interface Choice {
  /** Numbers of the splats that stay, the most seen first. */
  readonly kept: Uint32Array;
  /** [N] degree that each of them keeps. */
  readonly degrees: Uint8Array;
}

/** Applies a cut. The source is left as it is. */
export function reduce(cloud: GaussianCloud, scores: Scores, cut: Cut): ReducedCloud {
  const { contribution, removalError, lowered } = scores;
  const { minContribution = 0, removalPrice = 0, colourPrice = 0 } = cut;
  const staying = new Uint32Array(cloud.count);
  let count = 0;
  for (let i = 0; i < cloud.count; i++) {
    if (contribution[i] < minContribution || removalError[i] < removalPrice) continue;
    staying[count++] = i;
  }
  const kept = coarseToFine(cloud, contribution, staying.subarray(0, count));
  const degrees = Uint8Array.from(kept, (i) => degreeOf(cloud.shDegree, scores, i, colourPrice));
  const reduced = reduceTo(cloud, { kept, degrees });
  const length = 3 * shCoefficientCount(reduced.cloud.shDegree);
  for (let k = 0; k < kept.length; k++) {
    if (degrees[k] < cloud.shDegree) reduced.cloud.sh.set(lowered[degrees[k]].of(kept[k]), length * k);
  }
  return reduced;
}

/** The splats that stay, in their order. Coefficients of those that keep a lower degree than the cloud's are 0: to be put in by whoever knows them. */
export function reduceTo(cloud: GaussianCloud, { kept, degrees }: Choice): ReducedCloud {
  const highest = degrees.reduce((most, degree) => Math.max(most, degree), 0) as ShDegree;
  const reduced = {
    ...cloud,
    count: kept.length,
    positions: rowsOf(cloud.positions, 3, kept),
    scales: rowsOf(cloud.scales, 3, kept),
    rotations: rowsOf(cloud.rotations, 4, kept),
    opacities: rowsOf(cloud.opacities, 1, kept),
    sh: wholeColoursOf(cloud, kept, degrees, highest),
    shDegree: highest,
  };
  return { cloud: reduced, degrees, kept };
}

/** Some splats of a cloud, in an order. */
export function takeSplats(cloud: GaussianCloud, numbers: Uint32Array): GaussianCloud {
  return reduceTo(cloud, { kept: numbers, degrees: new Uint8Array(numbers.length).fill(cloud.shDegree) }).cloud;
}

/** Rows of so many numbers, in a new order. */
function rowsOf(values: Float32Array, width: number, kept: Uint32Array): Float32Array {
  const taken = new Float32Array(width * kept.length);
  for (let k = 0; k < kept.length; k++) {
    for (let column = 0; column < width; column++) taken[width * k + column] = values[width * kept[k] + column];
  }
  return taken;
}

/** The coefficients of the splats that keep all of theirs, in rows as long as the highest degree needs. */
function wholeColoursOf(
  { sh, shDegree }: GaussianCloud,
  kept: Uint32Array,
  degrees: Uint8Array,
  highest: ShDegree,
): Float32Array {
  const length = 3 * shCoefficientCount(highest);
  const colours = new Float32Array(length * kept.length);
  for (let k = 0; k < kept.length; k++) {
    if (degrees[k] < shDegree) continue;
    for (let number = 0; number < length; number++) colours[length * k + number] = sh[length * kept[k] + number];
  }
  return colours;
}

/** The same splats, the most seen first: by contribution times the area of the splat. */
export function coarseToFine({ scales }: GaussianCloud, contribution: Float32Array, splats: Uint32Array): Uint32Array {
  const importance = new Float32Array(splats.length);
  for (let k = 0; k < splats.length; k++) {
    const i = splats[k];
    const a = scales[3 * i];
    const b = scales[3 * i + 1];
    const c = scales[3 * i + 2];
    importance[k] = contribution[i] * Math.max(a * b, b * c, c * a);
  }
  const order = ascendingOrder(importance).reverse();
  for (let k = 0; k < order.length; k++) order[k] = splats[order[k]];
  return order;
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
