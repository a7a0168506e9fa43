import { shCoefficientCount, type GaussianCloud, type ShDegree } from '@gaussian-splat/core';
import { isOfPlanes } from '@gaussian-splat/renderer/stages';
import { coarseToFine } from './order.js';
import { allocateColumns, arraysOf, columnsOf } from './parts/cloud-memory.js';
import { inline, partsOf, poolFor, type TaskPool } from './parts/task-pool.js';
import type { Scores } from './score.js';
import { takeSplats } from './take-splats.js';

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
  /** From the most to the least seen, so that any beginning of it is a coarser image of all; of planes in the source's order. Coefficients above a splat's degree are 0. */
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

/**
 * The order in which splats of a cloud are written: the most seen first. Those of planes stay in the file's order, in which splats at equal depths are painted.
 * @param splats numbers of those that stay, ascending
 */
export function writtenOrder(
  cloud: Pick<GaussianCloud, 'scales' | 'positions'>,
  contribution: Float32Array,
  splats: Uint32Array,
): Uint32Array {
  return isOfPlanes(cloud.positions) ? splats.slice() : coarseToFine(cloud, contribution, splats);
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
  const kept = writtenOrder(cloud, contribution, staying.subarray(0, count));
  const degrees = Uint8Array.from(kept, (i) => degreeOf(cloud.shDegree, scores, i, colourPrice));
  const reduced = reduceTo(cloud, { kept, degrees });
  const length = 3 * shCoefficientCount(reduced.cloud.shDegree);
  for (let k = 0; k < kept.length; k++) {
    if (degrees[k] < cloud.shDegree) reduced.cloud.sh.set(lowered[degrees[k]].of(kept[k]), length * k);
  }
  return reduced;
}

/** The splats that stay, in their order. Coefficients of those that keep a lower degree than the cloud's are 0: to be put in by whoever knows them. */
export function reduceTo(cloud: GaussianCloud, choice: Choice): ReducedCloud {
  const reduced = roomFor(cloud, choice, inline);
  takeSplats({ from: cloud, to: reduced.cloud, ...choice, at: 0 });
  return reduced;
}

/** Some splats of a cloud, in an order. */
export function splatsOf(cloud: GaussianCloud, numbers: Uint32Array): GaussianCloud {
  return reduceTo(cloud, { kept: numbers, degrees: new Uint8Array(numbers.length).fill(cloud.shDegree) }).cloud;
}

/** The cloud without its harmonics above a degree. */
export function toDegree(degree: ShDegree, cloud: GaussianCloud): GaussianCloud {
  if (cloud.shDegree <= degree) return cloud;
  const [all, kept] = [3 * shCoefficientCount(cloud.shDegree), 3 * shCoefficientCount(degree)];
  const sh = new Float32Array(kept * cloud.count);
  for (let i = 0; i < cloud.count; i++) sh.set(cloud.sh.subarray(all * i, all * i + kept), kept * i);
  return { ...cloud, shDegree: degree, sh };
}

/** The same, in parts. What is left lies in memory that the pool's tasks share. */
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

/** A reduced cloud whose numbers are all 0. */
function roomFor(cloud: GaussianCloud, { kept, degrees }: Choice, pool: TaskPool): ReducedCloud {
  const highest = degreesOf(degrees).findLastIndex((count) => count > 0);
  const columns = allocateColumns(kept.length, Math.max(0, highest) as ShDegree, pool);
  return { cloud: { ...cloud, ...columns, count: kept.length }, degrees, kept };
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
  return degreesOf(degrees).reduce((sum, count, degree) => sum + 3 * count * ((degree + 1) ** 2 - 1), 0);
}
