import { shCoefficientCount, type GaussianCloud, type ShDegree } from '@gaussian-splat/core';
import type { Scores } from './score.js';

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
  const stride = 3 * shCoefficientCount(cloud.shDegree);
  const degrees = Uint8Array.from(kept, (i) => degreeOf(cloud.shDegree, scores, i, cut.colourPrice ?? 0));
  const highest = degrees.reduce((most, degree) => Math.max(most, degree), 0) as ShDegree;
  const length = 3 * shCoefficientCount(highest);
  const sh = new Float32Array(length * kept.length);
  kept.forEach((i, k) => {
    const numbers = 3 * (degrees[k] + 1) ** 2;
    const lowered = scores.lowered[degrees[k]];
    const own = lowered ? lowered.sh.subarray(numbers * i) : cloud.sh.subarray(stride * i);
    sh.set(own.subarray(0, numbers), length * k);
  });
  const take = (values: Float32Array, size: number): Float32Array => {
    const taken = new Float32Array(size * kept.length);
    kept.forEach((i, k) => taken.set(values.subarray(size * i, size * i + size), size * k));
    return taken;
  };
  return {
    cloud: {
      ...cloud,
      count: kept.length,
      positions: take(cloud.positions, 3),
      scales: take(cloud.scales, 3),
      rotations: take(cloud.rotations, 4),
      opacities: take(cloud.opacities, 1),
      sh,
      shDegree: highest,
    },
    degrees,
  };
}

/** Numbers of the splats that stay, the most seen first: by contribution times the area of the splat. */
function coarseToFine({ count, scales }: GaussianCloud, scores: Scores, cut: Cut): Uint32Array {
  const { contribution, removalError } = scores;
  const { minContribution = 0, removalPrice = 0 } = cut;
  const importance = new Float32Array(count);
  const kept = new Uint32Array(count);
  let length = 0;
  for (let i = 0; i < count; i++) {
    if (contribution[i] < minContribution || removalError[i] < removalPrice) continue;
    const [a, b, c] = [scales[3 * i], scales[3 * i + 1], scales[3 * i + 2]];
    importance[i] = contribution[i] * Math.max(a * b, b * c, c * a);
    kept[length++] = i;
  }
  return kept.slice(0, length).sort((a, b) => importance[b] - importance[a] || a - b);
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

/** Coefficients above the constant one that a reduced cloud keeps, all splats and channels together. */
export function keptCoefficients(degrees: Uint8Array): number {
  return degrees.reduce((sum, degree) => sum + 3 * ((degree + 1) ** 2 - 1), 0);
}
