import type { Camera, GaussianCloud } from '@gaussian-splat/core';
import { ascendingOrder } from '../order.js';
import type { Ranking } from '../score.js';
import { inline, partsOf, poolFor, type TaskPool } from '../parts/task-pool.js';
import { treeOf } from './neighbours.js';
import { FAVOURITES } from './pair-candidates.js';
import { PairCosts, pairState, type PairState } from './pair-costs.js';

/**
 * Number of views for evaluating pairs: with half as many wrong pairs are chosen, with three times as many the result
 * does not improve.
 */
const VIEWS = 16;
/** Rounds of merging pairs, which may include splats merged before. */
const MAX_ROUNDS = 6;
/** Equivalent cost of evaluating a splat's pairs, in splats to copy. */
const MOVES = 32;
/**
 * Maximum fraction of the pairs of a round that are merged, cheapest first: others may find better partners in the
 * next.
 */
const PART = 0.5;

/** Possible merges in order of application: `from[k]` is merged into `into[k]`. */
export interface Merges {
  readonly into: Uint32Array;
  readonly from: Uint32Array;
  /** Weight of the splat at `into` in the means of both, 0..1. */
  readonly shares: Float32Array;
  /** Opacity of the merged splat. */
  readonly opacities: Float32Array;
  /** Mean squared error of an image from a single merge, and at least that of the merges that it depends on. */
  readonly prices: Float32Array;
}

/** Pairs of one round, cheapest first. */
interface Pairs {
  readonly first: Uint32Array;
  readonly second: Uint32Array;
  readonly costs: Float32Array;
}

/**
 * Finds pairs of neighbors that resemble a single splat, by Ward's method (1963): the cheapest pairs are merged, and
 * all splats are paired again, until the estimated error exceeds the limit. Estimates are too low by a factor of about
 * ten, but in the right order.
 * @param views Sixteen of them, evenly spaced, are used to evaluate pairs.
 * @param maxError Limit of the mean squared error of images.
 * @param pool Evaluates pairs; its size does not affect the result.
 */
export async function findMerges(
  cloud: GaussianCloud,
  { contribution, removalError }: Ranking,
  views: readonly Camera[],
  maxError: number,
  pool: TaskPool = inline,
): Promise<Merges> {
  const chosen = poolFor(pool, MOVES * cloud.count);
  const state = pairState(cloud, contribution, evenly(views, VIEWS), (bytes) => chosen.allocate(bytes));
  const costs = new PairCosts(state);
  const merges = { into: [], from: [], shares: [], opacities: [], prices: [] } as Record<keyof Merges, number[]>;
  const prices = new Float32Array(cloud.count);
  // Splats that too few views contain are not merged.
  let slots = Uint32Array.from(removalError.keys()).filter((i) => Number.isFinite(removalError[i]));
  let spent = 0;
  for (let round = 0; round < MAX_ROUNDS && spent < maxError; round++) {
    const { first, second, costs: found } = pairsOf(await candidatesOf(state, slots, chosen), cloud.count);
    const isGone = new Uint8Array(cloud.count);
    const max = Math.ceil(PART * first.length);
    for (let k = 0; k < max && spent < maxError; k++) {
      const [i, j] = [first[k], second[k]];
      costs.cost(i, j);
      costs.join(i, j);
      spent += found[k];
      prices[i] = Math.max(found[k], prices[i], prices[j]);
      merges.into.push(i);
      merges.from.push(j);
      merges.shares.push(costs.share);
      merges.opacities.push(costs.opacity);
      merges.prices.push(prices[i]);
      isGone[j] = 1;
    }
    if (first.length === 0) break;
    slots = slots.filter((i) => !isGone[i]);
  }
  return {
    into: Uint32Array.from(merges.into),
    from: Uint32Array.from(merges.from),
    shares: Float32Array.from(merges.shares),
    opacities: Float32Array.from(merges.opacities),
    prices: Float32Array.from(merges.prices),
  };
}

/** Evenly spaced views, at most this many. */
function evenly(views: readonly Camera[], max: number): Camera[] {
  const step = views.length / Math.min(max, views.length);
  return Array.from({ length: Math.min(max, views.length) }, (_, k) => views[Math.floor(k * step)]);
}

/** Selects disjoint pairs greedily, cheapest first. */
function pairsOf(candidates: Pairs, count: number): Pairs {
  const isTaken = new Uint8Array(count);
  const pairs: [number, number, number][] = [];
  for (const k of ascendingOrder(candidates.costs)) {
    const [i, j] = [candidates.first[k], candidates.second[k]];
    if (isTaken[i] || isTaken[j]) continue;
    isTaken[i] = isTaken[j] = 1;
    pairs.push([i, j, candidates.costs[k]]);
  }
  return {
    first: Uint32Array.from(pairs, ([i]) => i),
    second: Uint32Array.from(pairs, ([, j]) => j),
    costs: Float32Array.from(pairs, ([, , cost]) => cost),
  };
}

/** Pairs of each splat with its most similar neighbors. */
async function candidatesOf(state: PairState, slots: Uint32Array, pool: TaskPool): Promise<Pairs> {
  const allocate = (bytes: number): ArrayBufferLike => pool.allocate(bytes);
  const count = state.visible.length;
  const positions = new PairCosts(state).positions(new Float32Array(allocate(12 * count), 0, 3 * count));
  const tree = treeOf(positions, slots, allocate);
  const room = FAVOURITES * slots.length;
  const partners = new Uint32Array(allocate(4 * room), 0, room);
  const costs = new Float32Array(allocate(4 * room), 0, room);
  const parts = partsOf(MOVES * slots.length, pool);
  const inputs = parts.map((part) => {
    const [first, end] = [part.first, part.end].map((move) => Math.round(move / MOVES));
    const [from, to] = [FAVOURITES * first, FAVOURITES * end];
    const own = { partners: partners.subarray(from, to), costs: costs.subarray(from, to) };
    return { state, tree, slots: slots.slice(first, end), ...own };
  });
  await pool.run('findPartners', inputs);
  const found = Uint32Array.from(costs.keys()).filter((k) => Number.isFinite(costs[k]));
  return {
    first: found.map((k) => slots[Math.floor(k / FAVOURITES)]),
    second: found.map((k) => partners[k]),
    costs: Float32Array.from(found, (k) => costs[k]),
  };
}
