import { boundsOf, validateCloud, type Bounds, type GaussianCloud } from '@gaussian-splat/core';
import { usableIndices, type PackOptions } from '../pack/pack.js';
import { mortonOrder } from '../pack/morton.js';
import { recentred } from '../pack/recentre.js';
import { choosePrecision, noiseIn } from '../pack/sh.js';
import type { StreamedScene } from './page-source.js';
import { joinSlots, packRun, type PackedRun } from './pack-run.js';
import { errorsOfSpacings, spacingOf } from './run-errors.js';
import { CHUNK_NUMBERS } from '../pack/words.js';

/** A part of a scene whose file has levels of detail of its own. */
export interface LevelBox {
  /** Corners, world units. */
  readonly min: readonly number[];
  readonly max: readonly number[];
  /** Splats of each level at most, the coarsest first. */
  readonly counts: readonly number[];
}

/** A level of a box as a page: it takes the place of the next coarser one. */
export interface LevelPage {
  readonly box: number;
  /** Index into the box's `counts`: 1 or more. */
  readonly level: number;
  /** Splats at most. */
  readonly count: number;
  /** Centre and radius, world units relative to the origin of the scene; the same for all levels of a box, so that only their errors decide. */
  readonly sphere: readonly number[];
  /** World units that what is shown is displaced. */
  readonly error: number;
}

/** A scene whose file has levels of its own, ready to be streamed. Plain data with a transferable buffer, so that a worker can make it. */
export interface LevelScene {
  readonly scene: StreamedScene;
  /** The page of all that is shown from the start: the coarsest level of each box, and what is in no box. */
  readonly first: Uint32Array<ArrayBuffer>;
  /** Chunks of each box in it, one after the other. */
  readonly firstChunks: readonly number[];
  /** All other pages, box by box, the coarser before the finer. */
  readonly pages: readonly LevelPage[];
}

/**
 * Lays out a scene whose file has levels of its own. What the levels displace is not known before they are there: the distance of splats is measured in the coarsest,
 * and is taken to go with the square root of their number, as for splats on surfaces.
 * @param coarsest the coarsest level of each box: its `levelRuns` have the number of the box as `node`. Runs of other nodes are shown always.
 * @param boxes each with one level or more
 * @throws GaussianSplatError `argument/cloud` if the arrays do not match `count` and `shDegree`.
 */
export function layOutLevels(
  coarsest: GaussianCloud,
  boxes: readonly LevelBox[],
  options: Pick<PackOptions, 'sh'> = {},
): LevelScene {
  validateCloud(coarsest);
  const cloud = recentred(coarsest);
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

/** Usable splats of each box, neighbours together, and behind them those that are in none. */
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

/** What is in no box, the sky for one, says nothing of where the scene is. */
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

/** Errors of the levels of a box, the coarsest first, by the spacing of that, or, where it has none, by the radius of the box. */
function errorsOf(counts: readonly number[], measured: number, radius: number): number[] {
  const spacing = measured > 0 ? measured : (2 * radius) / Math.sqrt(counts[0]);
  const spacings = counts.map((count) => spacing * Math.sqrt(counts[0] / count));
  return errorsOfSpacings(spacings.reverse()).reverse();
}

type Corners = Pick<LevelBox, 'min' | 'max'>;

/** Factor by which the radius is larger than it need be: more than float32 rounds. */
const SPARE = 1.00001;

/** Centre and radius of a ball around the boxes of chunks, and around a box that all levels are said to lie in. */
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
  return [...center, Math.fround(SPARE * radius)];
}
