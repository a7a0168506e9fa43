import { shCoefficientCount, type GaussianCloud, type ShDegree } from '@gaussian-splat/core';
import { isOfPlanes } from '@gaussian-splat/renderer/stages';
import { coarseToFine } from './order.js';
import { allocateColumns, arraysOf, columnsOf } from './parts/cloud-memory.js';
import { inline, partsOf, poolFor, type TaskPool } from './parts/task-pool.js';
import type { Scores } from './score.js';
import { takeSplats } from './take-splats.js';

/** Thresholds for reducing a scene. */
export interface Cut {
  /** Drops splats that contribute less than this to every pixel; 0, the default, keeps all. */
  readonly minContribution?: number;
  /** Drops splats whose removal costs less than this mean squared error; 0, the default, keeps all. */
  readonly removalPrice?: number;
  /** Mean squared error that a coefficient is worth: those that save less are dropped; 0, the default, keeps all. */
  readonly colorPrice?: number;
  /**
   * Merges pairs of similar splats up to this mean squared error, if the evaluator supports it ({@link
   * MergingEvaluator}); 0, the default, merges none.
   */
  readonly mergePrice?: number;
}

/** A cloud without its least important parts. */
export interface ReducedCloud {
  /**
   * Sorted by visibility, so that any prefix is a coarser image of the whole; scenes of planes keep the source's order.
   * Coefficients above a splat's degree are 0.
   */
  readonly cloud: GaussianCloud;
  /** [N] degree that each splat keeps. */
  readonly degrees: Uint8Array;
  /** [N] index in the source; for a merged splat that of one of its sources. */
  readonly kept: Uint32Array;
}

/** The remaining splats, and their color bands. */
export interface Choice {
  /** Indices of the remaining splats, most visible first. */
  readonly kept: Uint32Array;
  /** [N] degree that each of them keeps. */
  readonly degrees: Uint8Array;
}

/**
 * Order for writing the splats of a cloud: most visible first. Scenes of planes keep the order of the file, which
 * decides between splats of equal depth.
 * @param splats Indices of the remaining ones, ascending.
 */
export function writtenOrder(
  cloud: Pick<GaussianCloud, 'scales' | 'positions'>,
  contribution: Float32Array,
  splats: Uint32Array,
): Uint32Array {
  return isOfPlanes(cloud.positions) ? splats.slice() : coarseToFine(cloud, contribution, splats);
}

/** Applies a cut. The source is not modified. */
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

/**
 * Returns the remaining splats in order. Coefficients of splats with a reduced degree are 0, to be filled in by the
 * caller.
 */
export function reduceTo(cloud: GaussianCloud, choice: Choice): ReducedCloud {
  const reduced = roomFor(cloud, choice, inline);
  takeSplats({ from: cloud, to: reduced.cloud, ...choice, at: 0 });
  return reduced;
}

/** Returns some splats of a cloud in the given order. */
export function splatsOf(cloud: GaussianCloud, numbers: Uint32Array): GaussianCloud {
  return reduceTo(cloud, { kept: numbers, degrees: new Uint8Array(numbers.length).fill(cloud.shDegree) }).cloud;
}

/** Returns the cloud without harmonics above a degree. */
export function toDegree(degree: ShDegree, cloud: GaussianCloud): GaussianCloud {
  if (cloud.shDegree <= degree) return cloud;
  const [all, kept] = [3 * shCoefficientCount(cloud.shDegree), 3 * shCoefficientCount(degree)];
  const sh = new Float32Array(kept * cloud.count);
  for (let i = 0; i < cloud.count; i++) sh.set(cloud.sh.subarray(all * i, all * i + kept), kept * i);
  return { ...cloud, shDegree: degree, sh };
}

/** The same in parallel. The result is in memory that the pool's tasks share. */
export async function reduceInParts(cloud: GaussianCloud, choice: Choice, pool: TaskPool): Promise<ReducedCloud> {
  const reduced = roomFor(cloud, choice, pool);
  const [from, to] = [columnsOf(cloud), columnsOf(reduced.cloud)];
  const workers = poolFor(pool, choice.kept.length, [...arraysOf(from), ...arraysOf(to)]);
  const inputs = partsOf(choice.kept.length, workers).map(({ first, end }) => ({
    ...{ from, to, at: first, kept: choice.kept.slice(first, end), degrees: choice.degrees.slice(first, end) },
  }));
  await workers.run('takeSplats', inputs);
  return reduced;
}

/** Allocates a reduced cloud of zeros. */
function roomFor(cloud: GaussianCloud, { kept, degrees }: Choice, pool: TaskPool): ReducedCloud {
  const highest = degreesOf(degrees).findLastIndex((count) => count > 0);
  const columns = allocateColumns(kept.length, Math.max(0, highest) as ShDegree, pool);
  return { cloud: { ...cloud, ...columns, count: kept.length }, degrees, kept };
}

/** The degree that minimizes the error plus the price of the kept coefficients. */
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

/** [4] number of splats of each degree. */
export function degreesOf(degrees: Uint8Array): number[] {
  const counts = [0, 0, 0, 0];
  for (const degree of degrees) counts[degree]++;
  return counts;
}

/** Number of coefficients above the constant one in a reduced cloud, over all splats and channels. */
export function keptCoefficients(degrees: Uint8Array): number {
  return degreesOf(degrees).reduce((sum, count, degree) => sum + 3 * count * ((degree + 1) ** 2 - 1), 0);
}
