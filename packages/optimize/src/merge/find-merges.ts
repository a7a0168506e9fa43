import type { Camera, GaussianCloud } from '@gaussian-splat/core';
import { ascendingOrder } from '../order.js';
import type { Ranking } from '../score.js';
import { inline, partsOf, poolFor, type TaskPool } from '../parts/task-pool.js';
import { treeOf } from './neighbours.js';
import { FAVORITES } from './pair-candidates.js';
import { PairCosts, pairState, type PairState } from './pair-costs.js';

/**
 * Number of views that evaluate pairs. With half as many views, wrong pairs are chosen. Three times as many do
 * not improve the result.
 */
const VIEWS = 16;
/** Maximum number of rounds. Each round merges pairs, which may include merged splats of previous rounds. */
const MAX_ROUNDS = 6;
/** Time to evaluate the pairs of a splat, as a number of splats that are copied in the same time. */
const MOVES = 32;
/**
 * Maximum fraction of the pairs of a round that are merged, cheapest first. The others may find better partners in the
 * next round.
 */
const PART = 0.5;

/** Possible merges in the order of application. Arrays are [merges]; splat `from[k]` is merged into splat `into[k]`. */
export interface Merges {
  readonly into: Uint32Array;
  readonly from: Uint32Array;
  /** Weight of the splat `into` in the averages over both splats, 0..1. */
  readonly shares: Float32Array;
  /** Opacity of the merged splat, 0..1. */
  readonly opacities: Float32Array;
  /** Estimated mean squared error of an image from this merge; at least that of the merges on which it depends. */
  readonly prices: Float32Array;
}

/** Pairs of splats, and the estimated error of merging each pair. */
interface Pairs {
  readonly first: Uint32Array;
  readonly second: Uint32Array;
  readonly costs: Float32Array;
}

/**
 * Finds pairs of neighbors that resemble a single splat, by Ward's method (1963). Each round merges the cheapest pairs, and
 * the next round pairs all splats again, until the estimated error exceeds the limit. Estimates are too low by a factor of
 * about 10, but have the correct order.
 * @param views Scoring views; 16 of them, evenly spaced, evaluate pairs.
 * @param maxError Limit of the sum of estimates, a mean squared error.
 * @param pool Pool that evaluates pairs. Its size does not affect the result.
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

/** Returns at most `max` of the views, evenly spaced. */
function evenly(views: readonly Camera[], max: number): Camera[] {
  const step = views.length / Math.min(max, views.length);
  return Array.from({ length: Math.min(max, views.length) }, (_, k) => views[Math.floor(k * step)]);
}

/** Selects disjoint pairs greedily, and returns them in ascending order of costs. */
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

/** Returns the pairs of each splat with its most similar neighbors, by parallel tasks. */
async function candidatesOf(state: PairState, slots: Uint32Array, pool: TaskPool): Promise<Pairs> {
  const allocate = (bytes: number): ArrayBufferLike => pool.allocate(bytes);
  const count = state.visible.length;
  const positions = new PairCosts(state).positions(new Float32Array(allocate(12 * count), 0, 3 * count));
  const tree = treeOf(positions, slots, allocate);
  const room = FAVORITES * slots.length;
  const partners = new Uint32Array(allocate(4 * room), 0, room);
  const costs = new Float32Array(allocate(4 * room), 0, room);
  const parts = partsOf(MOVES * slots.length, pool);
  const inputs = parts.map((part) => {
    const [first, end] = [part.first, part.end].map((move) => Math.round(move / MOVES));
    const [from, to] = [FAVORITES * first, FAVORITES * end];
    const own = { partners: partners.subarray(from, to), costs: costs.subarray(from, to) };
    return { state, tree, slots: slots.slice(first, end), ...own };
  });
  await pool.run('findPartners', inputs);
  const found = Uint32Array.from(costs.keys()).filter((k) => Number.isFinite(costs[k]));
  return {
    first: found.map((k) => slots[Math.floor(k / FAVORITES)]),
    second: found.map((k) => partners[k]),
    costs: Float32Array.from(found, (k) => costs[k]),
  };
}
