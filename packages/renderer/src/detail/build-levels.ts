import type { GaussianCloud } from '@gaussian-splat/core';
import { Block, BLOCK } from './block.js';
import { BlockReducer } from './reduce-block.js';
import { chunksOf, emptyLevel, leafLevel, type SplatLevel } from './splat-level.js';

/** Splats of the next level for one of this. */
const KEPT = 1 / 4;

/**
 * All levels of detail of the splats `kept` of a cloud, finest first: each merges the splats of four chunks of the one before to those of one,
 * until one chunk holds the scene. All levels together have 4/3 of the splats.
 */
export function buildLevels(cloud: GaussianCloud, kept: Uint32Array): SplatLevel[] {
  return [...levelsAbove(leafLevel(cloud, kept))];
}

/** A level and all coarser ones. */
export function* levelsAbove(finest: SplatLevel): Generator<SplatLevel> {
  let level = finest;
  yield level;
  while (chunksOf(level.count) > 1) yield (level = nextLevel(level));
}

/** The next coarser level: chunk k of it stands for chunks 4 k to 4 k + 3. */
export function nextLevel(level: SplatLevel): SplatLevel {
  const reducer = new BlockReducer();
  const block = new Block();
  const next = emptyLevel(Math.ceil(level.count * KEPT), level);
  for (let first = 0, at = 0; first < level.count; first += BLOCK) {
    block.load(level, first, Math.min(BLOCK, level.count - first));
    reducer.reduce(block, Math.ceil(block.count * KEPT));
    block.store(next, at, level, first);
    at += block.count;
  }
  return next;
}
