import { upright } from '@gaussian-splat/formats';
import { boundsOf, validateCloud, type GaussianCloud } from '@gaussian-splat/core';
import {
  boundLevel,
  CENTER_ROUNDING,
  CHUNK_NUMBERS,
  type ChunkErrors,
  chunksOf,
  constants,
  DETAIL_NUMBERS,
  type DetailManifest,
  detailRows,
  leafErrors,
  leafLevel,
  levelsAbove,
  usableIndices,
  packFiller,
  packLevelGeometry,
  packLevelSh,
  packQuantizedChunk,
  type PageCoding,
  pageLayout,
  parentErrors,
  QUANTIZED_CHUNK_WORDS,
  type SplatLevel,
  widenReach,
} from '@gaussian-splat/renderer/tools';
import {
  countShells,
  keysOf,
  orderBy,
  planScene,
  positionsFrom,
  sampleOf,
  takeRows,
  type ScenePlan,
} from './scene-plan.js';
import { placeShells } from './shell-order.js';

const { CULL_GROUP } = constants;

/** A page of a tree, without the name of its file. */
export interface BuiltPage {
  readonly chunks: number;
  /** Number of the page's first chunks whose parent is in another page, or that have no parent. */
  readonly upper: number;
  /** Page of the tree that contains the parent, and index of the parent chunk in that page. */
  readonly parent?: readonly [page: number, chunk: number];
  /** Level of each chunk of the page (0 is the finest), and its index in the level. */
  readonly holds: readonly (readonly [level: number, chunk: number])[];
}

/** Levels of detail of a scene, or of a part of it, before the division into pages. Level 0 is the finest. */
export interface DetailTree extends Omit<ScenePlan, 'curve' | 'shells'> {
  /** Number of splats without padding. */
  readonly splats: number;
  /** Whether the finest level of the tree merges splats of finer levels, which are in other trees. */
  readonly isMerged?: boolean | undefined;
  readonly levels: readonly SplatLevel[];
  /** Rows of the struct `Chunk` for each level. */
  readonly chunks: readonly Float32Array[];
  readonly errors: readonly ChunkErrors[];
}

export interface DetailTreeOptions {
  /**
   * Precision of the geometry. `quantized` halves the bytes of centers, shapes and opacities. By default, they have the precision of scenes
   * that are not streamed.
   */
  readonly geometry?: 'quantized';
}

/**
 * Builds the levels of detail of a cloud. A scene with a direction up other than (0, -1, 0) is rotated.
 * @throws GaussianSplatError `argument/cloud` if the arrays do not match `count` and `shDegree`.
 */
export function buildDetailTree(given: GaussianCloud, { geometry }: DetailTreeOptions = {}): DetailTree {
  validateCloud(given);
  const standing = upright(given);
  const usable = usableIndices(standing);
  const plan = planScene(sampleOf(standing, usable), boundsOf(standing), geometry, usable.length);
  const cloud = { ...standing, origin: plan.origin, positions: positionsFrom(plan.origin, standing) };
  const { order, fillers } = orderOf(plan, cloud.positions, usable);
  const leaves = leafLevel(cloud, order);
  for (const { first, end } of fillers) leaves.opacities.fill(0, first, end);
  return treeOfPlan(plan, [leaves, ...levelsAbove(leaves)], { splats: usable.length });
}

/** Returns the splats in the order of a plan, with padding splats, which repeat the splat before them. */
function orderOf(plan: ScenePlan, positions: Float32Array, usable: Uint32Array) {
  const keys = keysOf(plan, takeRows(positions, 3, usable));
  const { end, fillers } = placeShells(countShells(keys));
  const sorted = orderBy(keys);
  const order = new Uint32Array(end);
  let [from, at] = [0, 0];
  for (const gap of [...fillers, { first: end, end }]) {
    for (; at < gap.first; at++) order[at] = usable[sorted[from++]];
    for (; at < gap.end; at++) order[at] = order[at - 1];
  }
  return { order, fillers };
}

/** Returns the tree of a scene, or of a part of it, with the facts of the scene. */
export function treeOfPlan(
  plan: ScenePlan,
  levels: readonly SplatLevel[],
  { splats, isMerged, errors }: { splats: number; isMerged?: boolean; errors?: ChunkErrors },
): DetailTree {
  return { ...treeOf(levels, plan.geometry, errors), ...plan, splats, isMerged };
}

/** Computes bounds and errors of levels. @param leaves Errors of the finest level; by default computed. */
export function treeOf(
  levels: readonly SplatLevel[],
  geometry: DetailTree['geometry'],
  leaves?: ChunkErrors,
): Pick<DetailTree, 'levels' | 'chunks' | 'errors'> {
  const chunks = levels.map(boundLevel);
  const errors = [leaves ?? leafErrors(chunks[0])];
  const rounding = geometry === undefined ? 0 : CENTER_ROUNDING;
  for (let k = 1; k < levels.length; k++) errors.push(parentErrors(levels[k], chunks[k], errors[k - 1], rounding));
  return { levels, chunks, errors };
}

/**
 * Divides a tree into pages, with parents before children. The first page has the coarsest chunk and its children. Each
 * other page has the children of a chunk, and their children.
 * @param withTop Whether pages include the coarsest chunk. If false, it belongs to another tree, and the first page begins
 * with its children.
 */
export function cutPages({ levels }: { levels: readonly Pick<SplatLevel, 'count'>[] }, withTop = true): BuiltPage[] {
  const pages: BuiltPage[] = [];
  const below = (level: number, chunks: readonly number[]): number[] =>
    level < 0
      ? []
      : chunks.flatMap((c) => [0, 1, 2, 3].map((k) => 4 * c + k)).filter((c) => c < chunksOf(levels[level].count));
  const add = (
    upper: number,
    upperChunks: readonly number[],
    parent: readonly [number, number] | undefined,
    isSingle = false,
  ): void => {
    const lowerChunks = isSingle ? [] : below(upper - 1, upperChunks);
    const holds = [...upperChunks.map((c) => [upper, c] as const), ...lowerChunks.map((c) => [upper - 1, c] as const)];
    const page = pages.push({ chunks: holds.length, upper: upperChunks.length, parent, holds }) - 1;
    const [finest, firstFinest] = isSingle ? [upperChunks, 0] : [lowerChunks, upperChunks.length];
    const level = isSingle ? upper - 1 : upper - 2;
    finest.forEach((c, k) => {
      const next = below(level, [c]);
      if (next.length > 0) add(level, next, [page, firstFinest + k]);
    });
  };
  const top = levels.length - 1;
  // If the number of levels is odd, the first page has only one level, so that the pages of the finest level, the most
  // numerous ones, have two levels.
  if (withTop) add(top, [0], undefined, top % 2 === 0);
  else if (top > 0) add(top - 1, below(top - 1, [0]), undefined, top % 2 === 1);
  return pages;
}

/** Returns the 32-bit words of a page's file, which docs/lod-format.md describes. */
export function packPage(tree: DetailTree, { holds, chunks }: BuiltPage): Uint32Array<ArrayBuffer> {
  const { levels, shPrecision, geometry: kind } = tree;
  const layout = pageLayout({ shDegree: levels[0].shDegree, shPrecision, geometry: kind }, chunks);
  const words = new Uint32Array(layout.total);
  const floats = new Float32Array(words.buffer);
  const geometryAt = layout.chunks + layout.details;
  const geometry = words.subarray(geometryAt, geometryAt + layout.geometry);
  const stride = layout.sh / (CULL_GROUP * chunks);
  holds.forEach(([level, chunk], k) => {
    const [from, end] = [CULL_GROUP * chunk, Math.min(levels[level].count, CULL_GROUP * (chunk + 1))];
    floats.set(tree.chunks[level].subarray(CHUNK_NUMBERS * chunk, CHUNK_NUMBERS * (chunk + 1)), CHUNK_NUMBERS * k);
    floats.set(rowOf(tree, level, chunk), layout.chunks + DETAIL_NUMBERS * k);
    if (kind === 'quantized') {
      packQuantizedChunk(levels[level], geometry, QUANTIZED_CHUNK_WORDS * k, from, end);
      widenReach(floats, CHUNK_NUMBERS * k);
    } else {
      packLevelGeometry(levels[level], geometry, CULL_GROUP * k, from, end);
      packFiller(geometry, CULL_GROUP * k + end - from, CULL_GROUP * (k + 1));
    }
    words.set(
      packLevelSh(levels[level], shPrecision, from, end),
      geometryAt + layout.geometry + stride * CULL_GROUP * k,
    );
  });
  return words;
}

function rowOf({ errors }: DetailTree, level: number, chunk: number): Float32Array {
  const one = (all: ChunkErrors, c: number): ChunkErrors => ({
    count: 1,
    spheres: all.spheres.subarray(4 * c, 4 * c + 4),
    errors: all.errors.subarray(c, c + 1),
  });
  const above = errors[level + 1];
  return detailRows(one(errors[level], chunk), above && one(above, chunk >> 2));
}

/**
 * Returns the manifest of a scene with one tree.
 * @param fileOf Returns the path of a page's file, by the index of the page.
 * @param coding Coding of the files; undefined for uncompressed words.
 */
export function manifestOf(
  tree: DetailTree,
  pages: readonly BuiltPage[],
  fileOf: (page: number) => string,
  coding?: PageCoding,
): DetailManifest {
  const stated = coding && statedOf(coding);
  const { splats, shPrecision, geometry, antialiased, filterVariance, order, credits, origin, bounds, levels } = tree;
  return {
    ...{
      format: 'gaussian-splat-detail',
      version: coding ? 4 : geometry ? 2 : 1,
      splats,
      shDegree: levels[0].shDegree,
    },
    ...{ shPrecision: coding ? 'int8' : shPrecision, ...(geometry && { geometry }), ...(stated && { coding: stated }) },
    ...{ antialiased, filterVariance, ...(order && { order }), ...credits, origin, bounds },
    trees: [
      {
        pages: pages.map(({ chunks, upper, parent }, p) => ({
          file: fileOf(p),
          chunks,
          upper,
          ...(parent && { parent }),
        })),
      },
    ],
    instances: [{ tree: 0, translate: [0, 0, 0] }],
  };
}

/** Returns a coding without the fields that only its writer needs. */
const statedOf = ({ size, directions, opacity, color, chroma, scale }: PageCoding): PageCoding => ({
  ...{ size, directions, opacity, color, chroma, scale },
});
