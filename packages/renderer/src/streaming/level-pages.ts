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
  /** Lower corner of the box, world units. */
  readonly min: readonly number[];
  /** Upper corner of the box, world units. */
  readonly max: readonly number[];
  /** Maximum number of splats in each level, coarsest first. */
  readonly counts: readonly number[];
}

/** A level of a box as a page, which replaces the next coarser level. */
export interface LevelPage {
  /** Index of the box. */
  readonly box: number;
  /** Index into the box's `counts`: 1 or more. */
  readonly level: number;
  /** Maximum number of splats. */
  readonly count: number;
  /**
   * Center and radius of a sphere in world units, relative to the origin of the scene. All levels of a box have the
   * same sphere, so that only their errors select a level.
   */
  readonly sphere: readonly number[];
  /** Displacement of this level in world units; 0 for the finest. */
  readonly error: number;
}

/**
 * A scene whose file has its own levels, prepared for streaming. Plain data with a transferable buffer, so that a
 * worker can build it.
 */
export interface LevelScene {
  readonly scene: StreamedScene;
  /** Words of the page that is always resident: the coarsest level of each box, then the splats outside all boxes. */
  readonly first: Uint32Array<ArrayBuffer>;
  /** Number of chunks of each box in `first`; they are consecutive. */
  readonly firstChunks: readonly number[];
  /** All other pages, box by box, coarser levels before finer ones. */
  readonly pages: readonly LevelPage[];
}

/**
 * Lays out a scene whose file has its own levels. The errors of unloaded levels are estimated: the spacing of splats is
 * measured in the coarsest level. It scales with the inverse square root of their number, as for splats on surfaces.
 * @param coarsest The coarsest level of each box. The `node` of its `levelRuns` is the index of a box; runs of other
 * nodes are always drawn.
 * @param boxes Boxes of the scene, each with at least one level.
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
  const shPrecision = sh === 'auto' ? choosePrecision(noiseIn(cloud, usable), usable.length) : sh;
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

/**
 * Returns the indices of the usable splats of each box in Morton order; the last array contains those outside all
 * boxes.
 */
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

/**
 * Returns the bounds of the splats in boxes. Splats outside all boxes, such as the sky, do not indicate the position of
 * the scene.
 */
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
 * Estimates the errors of the levels of a box in world units, coarsest first.
 * @param measured Spacing of the coarsest level in world units; 0 if unknown, the radius of the box then replaces it.
 */
function errorsOf(counts: readonly number[], measured: number, radius: number): number[] {
  const spacing = measured > 0 ? measured : (2 * radius) / Math.sqrt(counts[0]);
  const spacings = counts.map((count) => spacing * Math.sqrt(counts[0] / count));
  return errorsOfSpacings(spacings.reverse()).reverse();
}

type Corners = Pick<LevelBox, 'min' | 'max'>;

/** Factor that enlarges the radius by more than the rounding error of float32. */
const RADIUS_MARGIN = 1.00001;

/** Returns center and radius of a sphere around the boxes of chunks, and around the box that the file declares. */
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
