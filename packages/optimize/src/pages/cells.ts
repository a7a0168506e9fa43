import {
  constants,
  chunksOf,
  emptyLevel,
  FACTOR_NUMBERS,
  leafLevel,
  levelsAbove,
  shNumbers,
} from '@gaussian-splat/renderer/tools';
import type { ChunkErrors, SplatLevel } from '@gaussian-splat/renderer/tools';
import type { GaussianCloud, ShDegree } from '@gaussian-splat/core';
import { concatenated } from '@gaussian-splat/core/fetch';
import { cutPages, treeOfPlan, type BuiltPage, type DetailTree } from './build-pages.js';
import type { ScenePlan } from './scene-plan.js';

const { CULL_GROUP } = constants;

/**
 * Division of a scene into cells: runs of 256 · 4^n splats of its order. A cell becomes one chunk after n merges, so that
 * cells are built apart, and the levels above them are built from these chunks. The result does not depend on n.
 */
export class SceneCells {
  /** Number of splats in each level of the scene, finest first. */
  readonly counts: readonly number[];
  /** Number of merges of a cell: even, because a file has two levels. */
  readonly merges: number;
  readonly count: number;
  /** All pages of the scene, in the order of the manifest. */
  readonly pages: readonly BuiltPage[];

  /**
   * @param splats Number of splats of the finest level, with padding.
   * @param merges An even number.
   */
  constructor(splats: number, merges: number) {
    const counts = [splats];
    while (chunksOf(counts[counts.length - 1]) > 1) counts.push(Math.ceil(counts[counts.length - 1] / 4));
    this.counts = counts;
    this.merges = merges;
    this.count = Math.max(1, Math.ceil(splats / SceneCells.splatsOf(merges)));
    this.pages = cutPages({ levels: counts.map((count) => ({ count })) });
  }

  /** Returns the number of splats of a full cell. */
  static splatsOf(merges: number): number {
    return CULL_GROUP * 4 ** merges;
  }

  /** Returns the range of splats of a cell. */
  range(cell: number): { first: number; end: number } {
    const size = SceneCells.splatsOf(this.merges);
    return { first: size * cell, end: Math.min(this.counts[0], size * (cell + 1)) };
  }

  /** Returns the files of a cell, or those above all cells if `cell` is undefined, with chunks numbered in their tree. */
  files(cell: number | undefined): { page: BuiltPage; index: number }[] {
    return this.pages.flatMap((page, index) => {
      const [upper, chunk] = page.holds[0];
      const isAbove = this.count > 1 && upper > this.merges;
      const own = isAbove ? undefined : Math.floor(chunk / 4 ** Math.max(0, this.merges - upper));
      if (own !== cell) return [];
      const base = cell === undefined ? this.merges : 0;
      const first = (level: number): number => (cell === undefined ? 0 : cell * 4 ** (this.merges - level));
      const holds = page.holds.map(([level, c]) => [level - base, this.count > 1 ? c - first(level) : c] as const);
      return [{ page: { ...page, holds }, index }];
    });
  }

  /**
   * Builds the levels of a cell.
   * @param cloud Splats of the cell in their order, relative to the origin of the plan; padding has opacity 0.
   */
  build(plan: ScenePlan, cloud: GaussianCloud): DetailTree {
    const order = Uint32Array.from({ length: cloud.count }, (_, k) => k);
    const leaves = leafLevel(cloud, order);
    const levels = [leaves, ...levelsAbove(leaves, Math.min(this.merges, this.counts.length - 1))];
    return treeOfPlan(plan, levels, { splats: cloud.count });
  }

  /** Builds the levels above all cells from their last chunks, which {@link packTop} has packed. */
  join(plan: ScenePlan, tops: readonly Float32Array[], shDegree: ShDegree): DetailTree {
    const dilation = plan.antialiased ? 0 : (plan.filterVariance ?? constants.DILATION);
    const { level, errors } = unpackTops(tops, { shDegree, dilation });
    return treeOfPlan(plan, [level, ...levelsAbove(level)], { splats: this.counts[0], isMerged: true, errors });
  }
}

/** Packs the coarsest chunk of a cell: its number of splats, its sphere and error, and the arrays of its splats. */
export function packTop({ levels, errors }: DetailTree): Float32Array<ArrayBuffer> {
  const [level, own] = [levels[levels.length - 1], errors[errors.length - 1]];
  const arrays = [[level.count], own.spheres.subarray(0, 4), own.errors.subarray(0, 1), ...arraysOf(level)];
  return concatenated<Float32Array<ArrayBuffer>>(Float32Array, arrays);
}

function unpackTops(
  tops: readonly Float32Array[],
  { shDegree, dilation }: Pick<SplatLevel, 'shDegree' | 'dilation'>,
): { level: SplatLevel; errors: ChunkErrors } {
  const total = tops.reduce((sum, [count]) => sum + count, 0);
  const level = emptyLevel(total, { shDegree, dilation });
  const errors = {
    count: tops.length,
    spheres: new Float32Array(4 * tops.length),
    errors: new Float32Array(tops.length),
  };
  const widths = [3, FACTOR_NUMBERS, 1, 1, shNumbers(shDegree)];
  let splat = 0;
  tops.forEach((top, cell) => {
    const [count] = top;
    errors.spheres.set(top.subarray(1, 5), 4 * cell);
    errors.errors[cell] = top[5];
    let at = 6;
    arraysOf(level).forEach((array, k) => {
      array.set(top.subarray(at, at + widths[k] * count), widths[k] * splat);
      at += widths[k] * count;
    });
    splat += count;
  });
  return { level, errors };
}

/** Arrays of a level whose harmonics are in the order of its splats. */
const arraysOf = ({ positions, factors, opacities, spreads, sh }: SplatLevel): Float32Array[] => [
  ...[positions, factors, opacities, spreads, sh],
];
