import type { GaussianCloud, ShDegree } from '@gaussian-splat/core';
import { isOfPlanes } from '@gaussian-splat/renderer/stages';
import { coarseToFine } from './order.js';
import { allocateColumns, arraysOf, columnsOf } from './parts/cloud-memory.js';
import { inline, partsOf, poolFor, type TaskPool } from './parts/task-pool.js';
import { takeSplats } from './take-splats.js';

/** Thresholds of the parts of a scene that are dropped. Default of all: 0, which keeps everything. */
export interface Cut {
  /** Drops splats whose weight is below this value in every pixel, 0..1. */
  readonly minContribution?: number;
  /** Drops splats whose removal increases the mean squared error by less than this value. */
  readonly removalPrice?: number;
  /** Drops coefficients that reduce the mean squared error by less than this value each. */
  readonly colorPrice?: number;
  /**
   * Merges pairs of similar splats if that increases the mean squared error by at most this value. Only {@link
   * MergingEvaluator} supports it.
   */
  readonly mergePrice?: number;
}

/** A cloud after a cut. */
export interface ReducedCloud {
  /**
   * Remaining splats by descending visibility, so that any prefix is a coarser version of the scene. Scenes of planes
   * keep the order of the source. Coefficients above a splat's degree are 0.
   */
  readonly cloud: GaussianCloud;
  /** [N] degree of spherical harmonics that each splat keeps. */
  readonly degrees: Uint8Array;
  /** [N] index of each splat in the source. For a merged splat, the index of one of its sources. */
  readonly kept: Uint32Array;
}

/** Selection of the splats and bands of color that remain. */
export interface Choice {
  /** Indices of the remaining splats, most visible first. */
  readonly kept: Uint32Array;
  /** [N] degree of spherical harmonics that each remaining splat keeps. */
  readonly degrees: Uint8Array;
}

/**
 * Returns the order of splats in a file: the most visible first. Scenes of planes keep the order of the source,
 * which determines the image of splats at equal depth.
 * @param splats Indices of the remaining splats, ascending.
 */
export function writtenOrder(
  cloud: Pick<GaussianCloud, 'scales' | 'positions'>,
  contribution: Float32Array,
  splats: Uint32Array,
): Uint32Array {
  return isOfPlanes(cloud.positions) ? splats.slice() : coarseToFine(cloud, contribution, splats);
}

/**
 * Returns the chosen splats in their order. All coefficients of splats with a reduced degree are 0; the caller sets them.
 */
export function reduceTo(cloud: GaussianCloud, choice: Choice): ReducedCloud {
  const reduced = roomFor(cloud, choice, inline);
  takeSplats({ from: cloud, to: reduced.cloud, ...choice, at: 0 });
  return reduced;
}

/** Returns the splats of a cloud with the given indices, in this order. */
export function splatsOf(cloud: GaussianCloud, numbers: Uint32Array): GaussianCloud {
  return reduceTo(cloud, { kept: numbers, degrees: new Uint8Array(numbers.length).fill(cloud.shDegree) }).cloud;
}

/** Does the same as {@link reduceTo} by parallel tasks. The arrays of the result are in memory of the pool. */
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

/** Allocates a reduced cloud whose arrays are filled with zeros, of the highest kept degree. */
function roomFor(cloud: GaussianCloud, { kept, degrees }: Choice, pool: TaskPool): ReducedCloud {
  const highest = degreesOf(degrees).findLastIndex((count) => count > 0);
  const columns = allocateColumns(kept.length, Math.max(0, highest) as ShDegree, pool);
  return { cloud: { ...cloud, ...columns, count: kept.length }, degrees, kept };
}

/** Returns the number of splats of each degree, [4]. */
export function degreesOf(degrees: Uint8Array): number[] {
  const counts = [0, 0, 0, 0];
  for (const degree of degrees) counts[degree]++;
  return counts;
}

/** Returns the number of coefficients above the constant one in a reduced cloud, over all splats and channels. */
export function keptCoefficients(degrees: Uint8Array): number {
  return degreesOf(degrees).reduce((sum, count, degree) => sum + 3 * count * ((degree + 1) ** 2 - 1), 0);
}
