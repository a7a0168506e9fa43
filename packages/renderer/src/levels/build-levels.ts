import type { GaussianCloud } from '@gaussian-splat/core';
import { Block, BLOCK } from './block.js';
import { BlockReducer } from './reduce-block.js';
import { chunksOf, emptyLevel, leafLevel, type LevelSource, type SplatLevel } from './splat-level.js';

/** Number of splats of the next coarser level, as a fraction of the current level's. */
const KEPT = 1 / 4;
/** Number of blocks in each step, which takes about ten milliseconds. */
const BLOCKS_A_STEP = 8;

/**
 * Builds all levels of detail of the splats `kept` of a cloud, finest first. Each level merges the splats of four
 * chunks into one chunk, until one chunk represents the scene. All levels together have 4/3 of the splats.
 */
export function buildLevels(cloud: GaussianCloud, kept: Uint32Array): SplatLevel[] {
  const leaves = leafLevel(cloud, kept);
  return [leaves, ...levelsAbove(leaves)];
}

/**
 * Builds the levels that are coarser than the given one, finest first.
 * @param count Number of levels; default: until one chunk represents the scene.
 */
export function levelsAbove(finest: LevelSource, count?: number): SplatLevel[] {
  return finish(buildLevelsAbove(finest, count));
}

/**
 * Builds the levels of {@link levelsAbove}. Each step takes about ten milliseconds, so that
 * the thread can run other tasks.
 */
export function* buildLevelsAbove(finest: LevelSource, count?: number): Generator<void, SplatLevel[]> {
  const levels: SplatLevel[] = [];
  let level = finest;
  while (count === undefined ? chunksOf(level.count) > 1 : levels.length < count) {
    const next: SplatLevel = yield* buildNextLevel(level, (end) => Math.ceil(end * KEPT));
    levels.push(next);
    level = next;
  }
  return levels;
}

/**
 * Builds a level of `max` splats from one of up to four times as many. Its chunks do not correspond to those of the given
 * level.
 */
export const levelOf = (finest: LevelSource, max: number): SplatLevel =>
  finish(buildNextLevel(finest, (end) => Math.ceil((end * max) / finest.count)));

/**
 * Builds the next coarser level, in steps. If it has a quarter of the splats, its chunk k represents chunks 4 k to
 * 4 k + 3 of the given level.
 * @param keptOf Returns how many splats remain of the first `end` splats.
 */
function* buildNextLevel(level: LevelSource, keptOf: (end: number) => number): Generator<void, SplatLevel> {
  const reducer = new BlockReducer();
  const block = new Block();
  const next = emptyLevel(keptOf(level.count), level);
  for (let first = 0, at = 0; first < level.count; first += BLOCK) {
    block.load(level, first, Math.min(BLOCK, level.count - first));
    reducer.reduce(block, keptOf(first + block.count) - at);
    block.store(next, at);
    at += block.count;
    if ((first / BLOCK) % BLOCKS_A_STEP === BLOCKS_A_STEP - 1) yield;
  }
  return next;
}

/** Runs all steps of a generator without a pause, and returns its result. */
export function finish<T>(steps: Generator<void, T>): T {
  for (;;) {
    const { done, value } = steps.next();
    if (done) return value;
  }
}
