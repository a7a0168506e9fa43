/** A cut in plain code. */
import { shCoefficientCount, type GaussianCloud, type ShDegree } from '@gaussian-splat/core';
import type { Cut, ReducedCloud, Scores } from '@gaussian-splat/optimize';
import { reduceTo, writtenOrder } from '../../../packages/optimize/src/reduce.js';

/** Returns a cloud after a cut, except for merges. The source is not modified. */
export function reduce(cloud: GaussianCloud, scores: Scores, cut: Cut): ReducedCloud {
  const { contribution, removalError, lowered } = scores;
  const { minContribution = 0, removalPrice = 0, colorPrice = 0 } = cut;
  const staying = new Uint32Array(cloud.count);
  let count = 0;
  for (let i = 0; i < cloud.count; i++) {
    if (contribution[i] < minContribution || removalError[i] < removalPrice) continue;
    staying[count++] = i;
  }
  const kept = writtenOrder(cloud, contribution, staying.subarray(0, count));
  const degrees = Uint8Array.from(kept, (i) => degreeOf(cloud.shDegree, scores, i, colorPrice));
  const reduced = reduceTo(cloud, { kept, degrees });
  const length = 3 * shCoefficientCount(reduced.cloud.shDegree);
  for (let k = 0; k < kept.length; k++) {
    if (degrees[k] < cloud.shDegree) reduced.cloud.sh.set(lowered[degrees[k]].of(kept[k]), length * k);
  }
  return reduced;
}

/** Returns the degree of splat `i` that minimizes its error plus the price of the kept coefficients. */
function degreeOf(full: ShDegree, { lowered }: Scores, i: number, price: number): ShDegree {
  let best = full;
  let min = price * shCoefficientCount(full);
  for (let degree = 0; degree < full; degree++) {
    const cost = lowered[degree].error[i] + price * shCoefficientCount(degree as ShDegree);
    if (cost > min || (cost === min && price === 0)) continue;
    [best, min] = [degree as ShDegree, cost];
  }
  return price > 0 ? best : full;
}
