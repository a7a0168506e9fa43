import { matrixOfQuaternion, shCoefficientCount, type GaussianCloud } from '@gaussian-splat/core';
import { PlaceGrid } from './place-grid.js';

/**
 * Differences of color (constant coefficients), size (natural logarithm), opacity and shape that add 1 to the cost of a
 * match. Splats match at a cost of {@link MAX_COST} or less.
 */
const COLOR_UNIT = 0.25;
const SIZE_UNIT = 0.5;
const OPACITY_UNIT = 0.35;
const SHAPE_UNIT = 0.3;
const MAX_COST = 6;
/** Cost of a match below which the search ends. */
const SURE = 0.01;
/** Search radius in typical distances between neighbors. */
const RADIUS = 3;
/** Number of rounds. Splats whose best match belongs to another splat search again in the next round. */
const ROUNDS = 3;
/** Minimum fraction of matching splats with equal indices, so that indices identify splats. */
const SAME_NUMBERS = 0.7;
/** Ratio of the median {@link steadyCost} of equal indices to that of different ones, below which indices identify splats. */
const ALIKE = 0.02;
/** Number of splats that determine these medians. */
const SAMPLED = 2000;
/** Fraction of the frame's extent that a splat may move between frames if its index identifies it. Others begin a new track. */
const MAX_JUMP = 1 / 16;
/** Multiple of the median {@link lookCost} above which a pair is doubtful. */
const DOUBT = 9;
const MIN_DOUBT = 0.1;
/** Multiple of the median {@link lookCost} of equal indices, and minimum, above which a pair has other splats. */
const [NOISE, MIN_NOISE] = [50, 1];
/**
 * Number of passes over the unmatched splats. All passes except the last find only pairs of the same appearance.
 */
const SPARSE_PASSES = 3;
/** Search radius of these passes, in typical distances between unmatched splats. */
const SPARSE_RADIUS = 7.5;
/** Maximum cost of a pair in these passes. */
const SPARSE_COST = 2;
const MIN_SIZE = 1e-12;

/** Features that the matching of splats compares. */
export interface Features {
  readonly count: number;
  /** [N, 3] positions in units of the scene, relative to the origin of the sequence. */
  readonly positions: Float32Array;
  /** [N, 11] constant coefficients (3), size, opacity and shape (6), each divided by its unit. */
  readonly looks: Float32Array;
}

const LOOKS = 11;
/** Number of the first ones, which do not depend on the orientation of a splat. */
const STEADY_LOOKS = 5;
const OPACITY = 4;

export function featuresOf(cloud: GaussianCloud, origin: readonly number[]): Features {
  const { count, scales, opacities, sh, shDegree } = cloud;
  const shift = cloud.origin.map((value, axis) => value - origin[axis]);
  const positions = shift.some((value) => value !== 0)
    ? cloud.positions.map((value, k) => value + shift[k % 3])
    : cloud.positions;
  const looks = new Float32Array(LOOKS * count);
  const stride = 3 * shCoefficientCount(shDegree);
  for (let i = 0; i < count; i++) {
    for (let k = 0; k < 3; k++) looks[LOOKS * i + k] = sh[stride * i + k] / COLOR_UNIT;
    const volume = scales[3 * i] * scales[3 * i + 1] * scales[3 * i + 2];
    const longest = Math.max(scales[3 * i], scales[3 * i + 1], scales[3 * i + 2]);
    looks[LOOKS * i + 3] =
      (Math.log(Math.max(MIN_SIZE, longest)) + Math.log(Math.max(MIN_SIZE ** 3, volume)) / 3) / (2 * SIZE_UNIT);
    looks[LOOKS * i + 4] = opacities[i] / OPACITY_UNIT;
    putShape(cloud, i, looks, LOOKS * i + 5);
  }
  return { count, positions, looks };
}

/** Writes the shape of splat `i`: its covariance scaled to trace 1, which does not depend on the order of its axes. */
function putShape({ rotations, scales }: GaussianCloud, i: number, looks: Float32Array, at: number): void {
  const m = matrixOfQuaternion(rotations[4 * i], rotations[4 * i + 1], rotations[4 * i + 2], rotations[4 * i + 3]);
  let trace = 0;
  for (let k = 0; k < 3; k++) trace += scales[3 * i + k] ** 2;
  let number = at;
  for (let a = 0; a < 3; a++) {
    for (let b = a; b < 3; b++, number++) {
      let sum = 0;
      for (let k = 0; k < 3; k++) sum += scales[3 * i + k] ** 2 * m[3 * a + k] * m[3 * b + k];
      looks[number] = ((a === b ? 1 : Math.SQRT2) * sum) / (Math.max(trace, 1e-30) * SHAPE_UNIT);
    }
  }
}

/**
 * Matches the splats of a frame with those of the previous frame.
 * @param before Splats of the previous frame at the positions that are expected in the next frame.
 * @returns [splats of `next`] index of the match in `before`, or -1 for a new splat.
 */
export function matchFrames(before: Features, next: Features): Int32Array {
  const grid = PlaceGrid.of(next.positions, next.count, RADIUS);
  const named = byNumber(before, next, grid.cell);
  const found = named?.slice() ?? new Int32Array(next.count).fill(-1);
  let looking = whichOf(matchedIn(found, before.count), (is) => is === 0);
  byPlace(before, next, { grid, looking, found, max: MAX_COST });
  const all = doubtfulOf(before, next, found);
  const { limit } = all;
  const doubtful = all.doubtful.filter(({ j }) => !named || named[j] < 0);
  for (const { j } of doubtful) found[j] = -1;
  // Fast and sparse splats, such as spray, move farther than the typical distance between neighbors.
  for (let pass = 0; pass < SPARSE_PASSES; pass++) {
    const open = whichOf(found, (owner) => owner < 0);
    looking = whichOf(matchedIn(found, before.count), (is) => is === 0);
    if (open.length < 2 || looking.length === 0) break;
    const rest = featuresAt(next, open);
    const own = new Int32Array(open.length).fill(-1);
    byPlace(before, rest, {
      ...{ grid: PlaceGrid.of(rest.positions, rest.count, SPARSE_RADIUS), looking, found: own },
      max: SPARSE_COST,
      maxLooks: pass < SPARSE_PASSES - 1 ? limit : Infinity,
    });
    own.forEach((owner, k) => (found[open[k]] = owner));
  }
  const isMatched = matchedIn(found, before.count);
  for (const { i, j } of doubtful) if (found[j] < 0 && isMatched[i] === 0) found[j] = i;
  return found;
}

/** Returns which of the `count` splats of the previous frame have a match: 1, otherwise 0. */
function matchedIn(found: Int32Array, count: number): Uint8Array {
  const isMatched = new Uint8Array(count);
  for (const owner of found) if (owner >= 0) isMatched[owner] = 1;
  return isMatched;
}

/** A match: index `i` of a splat in the previous frame, and index `j` in the next frame. */
interface Pair {
  readonly i: number;
  readonly j: number;
}

/**
 * Returns the pairs whose appearance differs much more than that of most pairs, and the limit of {@link lookCost} for
 * this. Their correct matches may be beyond the search radius, as after a birth, when the velocity is unknown. Both splats
 * search again, and the pair remains if neither finds another match.
 */
function doubtfulOf(before: Features, next: Features, found: Int32Array): { doubtful: readonly Pair[]; limit: number } {
  const apart = new Float32Array(next.count).fill(-1);
  found.forEach((i, j) => {
    if (i >= 0) apart[j] = lookCost(before, i, next, j);
  });
  const sorted = apart.filter((cost) => cost >= 0).sort();
  const limit = Math.max(MIN_DOUBT, DOUBT * (sorted[sorted.length >> 1] ?? 0));
  return {
    limit,
    doubtful: Array.from(
      whichOf(apart, (cost) => cost > limit),
      (j) => ({ i: found[j], j }),
    ),
  };
}

/** Returns the cost of different colors, sizes and shapes. Opacity is excluded, because births and deaths are fades. */
function lookCost(a: Features, i: number, b: Features, j: number): number {
  let cost = 0;
  for (let k = 0; k < LOOKS; k++) if (k !== OPACITY) cost += (a.looks[LOOKS * i + k] - b.looks[LOOKS * j + k]) ** 2;
  return cost;
}

const whichOf = (values: Int32Array | Uint8Array | Float32Array, is: (value: number) => boolean): Uint32Array => {
  const found: number[] = [];
  for (let i = 0; i < values.length; i++) if (is(values[i])) found.push(i);
  return Uint32Array.from(found);
};

function featuresAt({ positions, looks }: Features, chosen: Uint32Array): Features {
  const own = { positions: new Float32Array(3 * chosen.length), looks: new Float32Array(LOOKS * chosen.length) };
  chosen.forEach((i, k) => {
    own.positions.set(positions.subarray(3 * i, 3 * i + 3), 3 * k);
    own.looks.set(looks.subarray(LOOKS * i, LOOKS * i + LOOKS), LOOKS * k);
  });
  return { count: chosen.length, ...own };
}

/** Returns the cost of a match; any number of at least `enough` if the cost is larger. @param unit Unit of distances. */
function costOf(a: Features, i: number, b: Features, j: number, unit: number, enough = Infinity): number {
  let cost = 0;
  for (let k = 0; k < 3; k++) cost += ((a.positions[3 * i + k] - b.positions[3 * j + k]) / unit) ** 2;
  for (let k = 0; k < LOOKS && cost < enough; k++) cost += (a.looks[LOOKS * i + k] - b.looks[LOOKS * j + k]) ** 2;
  return cost;
}

/**
 * Matches splats by index, if enough splats with equal indices match: in place, or only in appearance, because a splat of
 * a dense body that turns is farther from its place than from many others. Undefined otherwise.
 */
function byNumber(before: Features, next: Features, unit: number): Int32Array | undefined {
  if (before.count !== next.count) return undefined;
  const matched = (isSame: (i: number) => boolean): Int32Array | undefined => {
    const found = Int32Array.from({ length: next.count }, (_, i) => (isSame(i) ? i : -1));
    return whichOf(found, (i) => i >= 0).length >= SAME_NUMBERS * next.count ? found : undefined;
  };
  const isNamed = looksFollowNumbers(before, next);
  // Splats behind missing or new ones have other indices, and similar splats would change places.
  const costs = Float32Array.from({ length: next.count }, (_, i) => lookCost(before, i, next, i));
  const limit = Math.max(MIN_NOISE, NOISE * (costs.slice().sort()[next.count >> 1] ?? 0));
  const reach = MAX_JUMP * extentOf(next.positions);
  const isNear = (i: number): boolean => distanceOf(before, next, i) <= reach;
  const alike = (i: number): boolean => costs[i] <= limit && steadyCost(before, i, next, i) <= MAX_COST;
  // Limbs move farther in a frame than most splats are apart.
  const isSame = (i: number): boolean => costOf(before, i, next, i, unit) <= MAX_COST || (isNamed && isNear(i));
  return matched((i) => alike(i) && isSame(i)) ?? (isNamed ? matched(alike) : undefined);
}

const distanceOf = (a: Features, b: Features, i: number): number =>
  Math.hypot(...[0, 1, 2].map((k) => a.positions[3 * i + k] - b.positions[3 * i + k]));

/** Returns the largest side of the box around positions. */
function extentOf(positions: Float32Array): number {
  let side = 0;
  for (let axis = 0; axis < 3; axis++) {
    let [low, high] = [Infinity, -Infinity];
    for (let k = axis; k < positions.length; k += 3) {
      low = Math.min(low, positions[k]);
      high = Math.max(high, positions[k]);
    }
    side = Math.max(side, high - low);
  }
  return side;
}

/** Returns the cost of different colors, sizes and opacities, which do not change if a body turns. */
function steadyCost(a: Features, i: number, b: Features, j: number): number {
  let cost = 0;
  for (let k = 0; k < STEADY_LOOKS; k++) cost += (a.looks[LOOKS * i + k] - b.looks[LOOKS * j + k]) ** 2;
  return cost;
}

/** Whether splats with equal indices look alike, in contrast to those with different ones. */
function looksFollowNumbers(before: Features, next: Features): boolean {
  const { count } = next;
  const sampled = Math.min(SAMPLED, count);
  const median = (shift: number): number =>
    Float64Array.from({ length: sampled }, (_, k) => {
      const i = Math.floor((k * count) / sampled);
      return steadyCost(before, i, next, (i + shift) % count);
    }).sort()[sampled >> 1];
  return median(0) < ALIKE * median(Math.ceil(count / 3));
}

interface Search {
  readonly grid: PlaceGrid;
  /** Indices of the splats in the previous frame that search a match. */
  readonly looking: Uint32Array;
  /** [splats of the next frame] index of the match in the previous frame, or -1. The search sets it. */
  readonly found: Int32Array;
  /** Maximum cost of a match. */
  readonly max: number;
  /** Maximum {@link lookCost} of a match; default no limit. */
  readonly maxLooks?: number;
}

/**
 * Finds the matches with the smallest cost. If several splats choose the same match, the one with the smallest cost gets
 * it, and the others search again.
 */
function byPlace(before: Features, next: Features, { grid, found, max, maxLooks = Infinity, ...search }: Search): void {
  const costs = new Float32Array(next.count);
  let { looking } = search;
  for (let round = 0; round < ROUNDS && looking.length > 0; round++) {
    const isOpen = found.map((owner) => (owner < 0 ? 1 : 0));
    const lost: number[] = [];
    for (const i of looking) {
      let [best, min] = [-1, max];
      grid.forEachNear(before.positions, i, (j) => {
        if (isOpen[j] === 0) return false;
        const cost = costOf(before, i, next, j, grid.cell, min);
        if (cost >= min || (maxLooks < cost && lookCost(before, i, next, j) > maxLooks)) return false;
        [best, min] = [j, cost];
        return cost < SURE;
      });
      if (best < 0) continue;
      const owner = found[best];
      if (owner >= 0 && costs[best] <= min) {
        lost.push(i);
        continue;
      }
      if (owner >= 0) lost.push(owner);
      found[best] = i;
      costs[best] = min;
    }
    looking = Uint32Array.from(lost);
  }
}
