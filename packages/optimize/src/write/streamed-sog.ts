import type { GaussianCloud } from '@gaussian-splat/core';
import { concatenated } from '@gaussian-splat/core/fetch';
import { assetOfCredits, upright } from '@gaussian-splat/formats';
import { packedOrder } from '@gaussian-splat/renderer/tools';
import { buildLevels, recentered, type SplatLevel } from '@gaussian-splat/renderer/stages';
import { cloudOf } from '../merge/fewer-splats.js';
import { nothingToWrite, sogFiles, type SogOptions } from './sog.js';

/** Name of the index. */
const LOD_INDEX = 'lod-meta.json';
/** Whether a file of this name is the index of a streamed scene. */
export const isLodIndex = (name: string): boolean => /(^|[\\/])lod-meta\.json$/i.test(name);
/** Splats of the coarsest level of a box, one chunk of the renderer; and the ratio between the splats of two levels. */
const CHUNK = 256;
const KEPT = 4;
/**
 * Minimum number of levels of a scene with enough splats, and the maximum number of splats in all coarsest levels
 * together. More splats would delay the first frame.
 */
const MIN_LEVELS = 4;
const MAX_COARSEST_CHUNKS = 40_000;
/** Maximum number of splats in a file. The renderer shows no splat of a file before the file is complete. */
const FILE_SPLATS = 131_072;

/** A region of the scene: neighboring splats, and their coarser levels. */
interface Box {
  /** Indices of the region's splats in the cloud. */
  readonly kept: Uint32Array;
  /** Finest level first. */
  readonly levels: readonly SplatLevel[];
}

interface Run {
  readonly file: number;
  readonly offset: number;
  readonly count: number;
}

/**
 * Writes streamed SOG: an index, `lod-meta.json`, and SOG files of some boxes at one level of detail each. Each level
 * has a quarter of the splats of the previous one. A scene with an up direction other than (0, -1, 0) is rotated.
 * @returns Files by path; the index is last.
 * @throws GaussianSplatError `argument/cloud` for a scene without usable splats.
 */
export async function writeStreamedSog(
  given: GaussianCloud,
  options: SogOptions,
): Promise<ReadonlyMap<string, Uint8Array>> {
  const cloud = recentered(upright(given));
  const order = packedOrder(cloud);
  if (order.length === 0) throw nothingToWrite();
  const boxes = boxesOf(cloud, order);
  const lodLevels = Math.max(...boxes.map(({ levels }) => levels.length));
  const files = new Map<string, Uint8Array>();
  const filenames: string[] = [];
  const lods: Record<string, Run>[] = boxes.map(() => ({}));
  for (let level = 0; level < lodLevels; level++) {
    for (const [k, group] of groupsOf(boxes, level).entries()) {
      let offset = 0;
      for (const box of group) {
        const { count } = boxes[box].levels[level];
        lods[box][level] = { file: filenames.length, offset, count };
        offset += count;
      }
      const parts = group.map((box) => boxes[box]);
      const part =
        level === 0
          ? cloud
          : cloudOf(
              parts.map(({ levels }) => levels[level]),
              cloud,
            );
      const kept =
        level === 0
          ? concatenated(
              Uint32Array,
              parts.map((box) => box.kept),
            )
          : Uint32Array.from({ length: offset }, (_, i) => i);
      const folder = `${level}_${k}`;
      filenames.push(`${folder}/meta.json`);
      for (const [name, bytes] of await sogFiles(part, kept, level === 0 ? options : { ...options, seen: undefined }))
        files.set(`${folder}/${name}`, bytes);
    }
  }
  const children = boxes.map(({ kept }, box) => ({ bound: boundOf(cloud, kept), lods: lods[box] }));
  const asset = cloud.hints?.credits && { asset: assetOfCredits(cloud.hints.credits) };
  const index = { ...asset, lodLevels, environment: null, filenames, tree: { bound: boundOf(cloud, order), children } };
  return files.set(LOD_INDEX, new TextEncoder().encode(JSON.stringify(index)));
}

/** Divides the splats into boxes whose counts differ by at most 1, so that all boxes have equally many levels. */
function boxesOf(cloud: GaussianCloud, order: Uint32Array): Box[] {
  let max = CHUNK * KEPT ** (MIN_LEVELS - 1);
  while ((order.length * CHUNK) / max > MAX_COARSEST_CHUNKS) max *= KEPT;
  const count = Math.ceil(order.length / max);
  return Array.from({ length: count }, (_, box) => {
    const [first, end] = [box, box + 1].map((k) => Math.floor((k * order.length) / count));
    const kept = order.slice(first, end);
    return { kept, levels: buildLevels(cloud, kept) };
  });
}

/** Returns groups of indices of boxes: the splats of a group at this level are in one file. */
function groupsOf(boxes: readonly Box[], level: number): number[][] {
  const groups: number[][] = [];
  let splats = Infinity;
  boxes.forEach(({ levels }, box) => {
    if (level >= levels.length) return;
    const { count } = levels[level];
    if (splats + count > FILE_SPLATS) {
      groups.push([]);
      splats = 0;
    }
    groups[groups.length - 1].push(box);
    splats += count;
  });
  return groups;
}

/** Returns the axis-aligned bounds of the splats' centers, in world units. */
function boundOf({ positions, origin }: GaussianCloud, kept: Uint32Array): { min: number[]; max: number[] } {
  const [min, max] = [
    [Infinity, Infinity, Infinity],
    [-Infinity, -Infinity, -Infinity],
  ];
  for (const i of kept) {
    for (let axis = 0; axis < 3; axis++) {
      const value = positions[3 * i + axis] + origin[axis];
      min[axis] = Math.min(min[axis], value);
      max[axis] = Math.max(max[axis], value);
    }
  }
  return { min, max };
}
