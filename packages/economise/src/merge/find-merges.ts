import type { Camera, GaussianCloud } from '@gaussian-splat/core';
import { ascendingOrder } from '../order.js';
import type { Ranking } from '../score.js';
import { nearestNeighbours } from './neighbours.js';
import { PairCosts } from './pair-costs.js';

/** Views that pairs are looked at in: with half as many the wrong pairs are taken, with three times as many none better. */
const VIEWS = 16;
/** Neighbours that a splat may be merged with, and how many of them are looked at in all views rather than in every fourth. */
const NEIGHBOURS = 10;
const FAVOURITES = 4;
const GLANCE = 4;
/** Rounds of pairs: each may make one of two that were made before. */
const MOST_ROUNDS = 6;
/** Part of the pairs of a round that are merged at most, the cheapest: others may find better partners in the next. */
const PART = 0.5;

/** What may be merged, in the order in which it would be: `from[k]` becomes part of `into[k]`. */
export interface Merges {
  readonly into: Uint32Array;
  readonly from: Uint32Array;
  /** What the splat at `into` counts for in the means of both, 0..1. */
  readonly shares: Float32Array;
  /** Opacity of both as one. */
  readonly opacities: Float32Array;
  /** Mean squared error of an image that a merge costs by itself, and at least that of those that it stands on. */
  readonly prices: Float32Array;
}

/** Pairs of one round, the cheapest first. */
interface Pairs {
  readonly first: Uint32Array;
  readonly second: Uint32Array;
  readonly costs: Float32Array;
}

/**
 * Finds pairs of neighbours that look like one splat, by Ward's way (1963): the cheapest pairs become one, and these and the others are paired anew, until the estimated error is more than any that
 * matters. Estimates are too low by a factor of ten or so, but in the right order.
 * @param views to look at pairs in; sixteen of them, evenly, are
 * @param mostError mean squared error of the images that matters at most
 */
export function findMerges(
  cloud: GaussianCloud,
  { contribution, removalError }: Ranking,
  views: readonly Camera[],
  mostError: number,
): Merges {
  const costs = new PairCosts(cloud, contribution, evenly(views, VIEWS));
  const merges = { into: [], from: [], shares: [], opacities: [], prices: [] } as Record<keyof Merges, number[]>;
  const prices = new Float32Array(cloud.count);
  // Splats that too few views looked at stay as they are.
  let slots = Uint32Array.from(removalError.keys()).filter((i) => Number.isFinite(removalError[i]));
  let spent = 0;
  for (let round = 0; round < MOST_ROUNDS && spent < mostError; round++) {
    const { first, second, costs: found } = pairsOf(costs, slots, cloud.count);
    const isGone = new Uint8Array(cloud.count);
    const most = Math.ceil(PART * first.length);
    for (let k = 0; k < most && spent < mostError; k++) {
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

/** So many of the views, or all. */
function evenly(views: readonly Camera[], most: number): Camera[] {
  const step = views.length / Math.min(most, views.length);
  return Array.from({ length: Math.min(most, views.length) }, (_, k) => views[Math.floor(k * step)]);
}

/** Pairs of which no two share a splat: the cheapest of all, the cheapest of the rest, and so on. */
function pairsOf(costs: PairCosts, slots: Uint32Array, count: number): Pairs {
  const candidates = candidatesOf(costs, slots);
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

/** Each splat with those of its neighbours that it looks most alike with. */
function candidatesOf(costs: PairCosts, slots: Uint32Array): Pairs {
  const neighbours = nearestNeighbours(costs.positions(), slots, NEIGHBOURS);
  const room = FAVOURITES * slots.length;
  const [first, second, found] = [new Uint32Array(room), new Uint32Array(room), new Float32Array(room)];
  const glances = new Float32Array(NEIGHBOURS);
  let count = 0;
  for (let k = 0; k < slots.length; k++) {
    const i = slots[k];
    const own = neighbours.subarray(NEIGHBOURS * k, NEIGHBOURS * (k + 1));
    for (let n = 0; n < NEIGHBOURS; n++) glances[n] = own[n] < 0 ? Infinity : costs.cost(i, own[n], GLANCE);
    for (let n = 0; n < FAVOURITES; n++) {
      const best = glances.indexOf(Math.min(...glances));
      if (!Number.isFinite(glances[best])) break;
      glances[best] = Infinity;
      const cost = costs.cost(i, own[best]);
      if (!Number.isFinite(cost)) continue;
      [first[count], second[count], found[count]] = [i, own[best], cost];
      count++;
    }
  }
  return { first: first.subarray(0, count), second: second.subarray(0, count), costs: found.subarray(0, count) };
}
