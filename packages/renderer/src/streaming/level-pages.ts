import { boundsOf, validateCloud, type Bounds, type GaussianCloud } from '@gaussian-splat/core';
import { usableIndices, type PackOptions } from '../pack/pack.js';
import { mortonOrder } from '../pack/morton.js';
import { recentered } from '../pack/recenter.js';
import { choosePrecision, noiseIn } from '../pack/sh.js';
import type { StreamedScene } from './page-source.js';
import { joinSlots, packRun, type PackedRun } from './pack-run.js';
import { errorsOfSpacings, spacingOf } from './run-errors.js';
import { CHUNK_NUMBERS } from '../pack/words.js';

/** A region of a scene whose file has its own levels of detail. */
export interface LevelBox {
  /** Corners, world units. */
  readonly min: readonly number[];
  readonly max: readonly number[];
  /** Maximum number of splats in each level, coarsest first. */
  readonly counts: readonly number[];
}

/** A level of a box as a page: it replaces the next coarser one. */
export interface LevelPage {
  readonly box: number;
  /** Index into the box's `counts`: 1 or more. */
  readonly level: number;
  /** Maximum number of splats. */
  readonly count: number;
  /**
   * Center and radius, world units relative to the origin of the scene; the same for all levels of a box, so that only
   * their errors decide.
   */
  readonly sphere: readonly number[];
  /** Error in world units. */
  readonly error: number;
}

/**
 * A scene whose file has its own levels, ready for streaming. Plain data with a transferable buffer, so that a worker
 * can build it.
 */
export interface LevelScene {
  readonly scene: StreamedScene;
  /** The page that is always resident: the coarsest level of each box, and the splats outside all boxes. */
  readonly first: Uint32Array<ArrayBuffer>;
  /** Chunks of each box in it, in sequence. */
  readonly firstChunks: readonly number[];
  /** All other pages, box by box, coarser before finer. */
  readonly pages: readonly LevelPage[];
}

/**
 * Lays out a scene whose file has its own levels. Their errors are unknown before they are loaded: the spacing of
 * splats is measured in the coarsest level, and assumed to scale with the inverse square root of their number, as for
 * splats on surfaces.
 * @param coarsest The coarsest level of each box: its `levelRuns` have the index of the box as `node`. Runs of other
 * nodes are always shown.
 * @param boxes Each with at least one level.
 * @throws GaussianSplatError `argument/cloud` if the arrays do not match `count` and `shDegree`.
 */
export function layoutLevels(
  coarsest: GaussianCloud,
  boxes: readonly LevelBox[],
  options: Pick<PackOptions, 'sh'> = {},
): LevelScene {
  validateCloud(coarsest);
  const cloud = recentered(coarsest);
  const usable = usableIndices(cloud);
  const { sh = 'auto' } = options;
  const { shDegree, antialiased, filterVariance, origin, hints } = cloud;
  const shPrecision = sh === 'auto' ? choosePrecision(noiseIn(cloud), usable) : sh;
  const bounds = boundsWithin(coarsest, boxes.length);
  const kept = keptOfNodes(cloud, usable, boxes.length);
  const format = { shDegree, shPrecision, geometry: 'quantized' } as const;
  const runs: PackedRun[] = [];
  const pages: LevelPage[] = [];
  boxes.forEach((box, b) => {
    const corners = {
      min: box.min.map((x, axis) => x - origin[axis]),
      max: box.max.map((x, axis) => x - origin[axis]),
    };
    const packed = packRun(cloud, kept[b], format, corners);
    const sphere = sphereAround(packed.chunks, corners);
    const errors = errorsOf(box.counts, spacingOf(cloud.positions, kept[b]), sphere[3]);
    runs.push({ ...packed, sphere, error: errors[0] });
    box.counts.forEach((count, level) => {
      if (level > 0) pages.push({ box: b, level, count, sphere, error: errors[level] });
    });
  });
  const around = kept.at(-1)!;
  if (around.length > 0) {
    const packed = packRun(cloud, around, format);
    runs.push({ ...packed, sphere: sphereAround(packed.chunks), error: 0 });
  }
  const splats = boxes.reduce((sum, { counts }) => sum + counts.at(-1)!, around.length);
  const scene = { ...format, splats, antialiased, filterVariance, order: hints?.order, origin, bounds };
  const firstChunks = runs.slice(0, boxes.length).map(({ chunks }) => chunks.length / CHUNK_NUMBERS);
  return { scene, first: joinSlots(runs, scene), firstChunks, pages };
}

/** Usable splats of each box, neighbors together, followed by those outside all boxes. */
function keptOfNodes({ positions, levelRuns = [] }: GaussianCloud, usable: Uint32Array, boxes: number): Uint32Array[] {
  const kept: Uint32Array[] = Array.from({ length: boxes }, () => new Uint32Array(0));
  const others: number[] = [];
  let at = 0;
  for (const { first, count, node } of [...levelRuns].sort((a, b) => a.first - b.first)) {
    const from = at;
    while (at < usable.length && usable[at] < first + count) at++;
    const own = usable.subarray(from, at);
    if (node < boxes) kept[node] = mortonOrder(positions, own.slice());
    else for (const i of own) others.push(i);
  }
  return [...kept, mortonOrder(positions, Uint32Array.from(others))];
}

/** Splats outside all boxes, such as the sky, do not indicate the position of the scene. */
function boundsWithin(cloud: GaussianCloud, boxes: number): Bounds {
  const runs = (cloud.levelRuns ?? []).filter(({ node, count }) => node < boxes && count > 0);
  const total = runs.reduce((sum, { count }) => sum + count, 0);
  if (total === 0) return boundsOf(cloud);
  const [positions, opacities] = [new Float32Array(3 * total), new Float32Array(total)];
  let at = 0;
  for (const { first, count } of runs) {
    positions.set(cloud.positions.subarray(3 * first, 3 * (first + count)), 3 * at);
    opacities.set(cloud.opacities.subarray(first, first + count), at);
    at += count;
  }
  return boundsOf({ count: total, positions, opacities, origin: cloud.origin });
}

/**
 * Errors of the levels of a box, coarsest first, from the measured spacing, or from the radius of the box if there is
 * none.
 */
function errorsOf(counts: readonly number[], measured: number, radius: number): number[] {
  const spacing = measured > 0 ? measured : (2 * radius) / Math.sqrt(counts[0]);
  const spacings = counts.map((count) => spacing * Math.sqrt(counts[0] / count));
  return errorsOfSpacings(spacings.reverse()).reverse();
}

type Corners = Pick<LevelBox, 'min' | 'max'>;

/** Factor that enlarges the radius by more than the rounding error of float32. */
const RADIUS_MARGIN = 1.00001;

/** Center and radius of a sphere around the boxes of chunks, and around the declared box of all levels. */
function sphereAround(chunks: Float32Array, box?: Corners): number[] {
  const low = box ? box.min.map((x, axis) => Math.min(x, box.max[axis])) : [Infinity, Infinity, Infinity];
  const high = box ? box.max.map((x, axis) => Math.max(x, box.min[axis])) : [-Infinity, -Infinity, -Infinity];
  for (let at = 0; at < chunks.length; at += CHUNK_NUMBERS) {
    for (let axis = 0; axis < 3; axis++) {
      low[axis] = Math.min(low[axis], chunks[at + axis]);
      high[axis] = Math.max(high[axis], chunks[at + 4 + axis]);
    }
  }
  const center = low.map((x, axis) => Math.fround((x + high[axis]) / 2));
  const radius = Math.hypot(...center.map((x, axis) => Math.max(high[axis] - x, x - low[axis])));
  return [...center, Math.fround(RADIUS_MARGIN * radius)];
}
