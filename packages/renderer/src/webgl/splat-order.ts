/**
 * Sorts splats by depth on the CPU, because WebGL has no compute shaders. Uses neither the DOM nor a GPU, because a
 * worker runs this code.
 */
import { eyeOf, subtract, type Camera, type Vector3 } from '@gaussian-splat/core';
import { drawnChunks, type LevelChoice } from './level-choice.js';

/**
 * Parameters of an order. Splats are sorted by the depth axis · p + offset of their position p, or by their distance
 * from `point`.
 */
export interface OrderView {
  readonly axis: Vector3;
  readonly offset: number;
  /** Minimum depth of the listed splats. */
  readonly near: number;
  /** Maximum depth of the listed splats. */
  readonly far: number;
  /**
   * Center of an order by distance, relative to the origin of the splat positions; undefined for an order by depth. An
   * order by distance lists all splats, and does not change when the camera rotates.
   */
  readonly point?: Vector3 | undefined;
  /** Rows of the camera matrix for x and y, in units of half the image at depth 1, with the center of the image. */
  readonly across: readonly (readonly [x: number, y: number, z: number, offset: number, center: number])[];
  /** Fraction of the image that a splat with one unit of area covers at depth 1. */
  readonly shareOfArea: number;
  /** Whether the camera is orthographic. */
  readonly isParallel: boolean;
  /** Index of the first splat of the scene among those of several scenes; default: 0. */
  readonly first?: number;
  /** Selection of levels of detail; undefined for a scene without levels. */
  readonly levels?: LevelChoice | undefined;
}

/** Changes of a streamed scene: numbers, and the index of the first one among those of all splats or chunks. */
export type SplatUpdate = Readonly<
  Record<'positions' | 'details', readonly { readonly at: number; readonly numbers: Float32Array<ArrayBuffer> }[]>
>;

/** Returns the parameters for an order by depth. @param origin World position of the origin of the splat positions. */
export function orderView(camera: Camera, origin: Vector3): OrderView {
  const { worldToCamera: m, near, far, width, height, fx, fy, cx, cy, orthographic = false } = camera;
  const axis: Vector3 = [m[8], m[9], m[10]];
  const offsetOf = (row: number): number =>
    m[row] * origin[0] + m[row + 1] * origin[1] + m[row + 2] * origin[2] + m[row + 3];
  const acrossOf = (row: number, focal: number, center: number, size: number): OrderView['across'][number] => {
    const scale = (2 * focal) / size;
    return [scale * m[row], scale * m[row + 1], scale * m[row + 2], scale * offsetOf(row), (2 * center) / size - 1];
  };
  return {
    ...{ axis, offset: offsetOf(8), near, far, isParallel: orthographic },
    across: [acrossOf(0, fx, cx, width), acrossOf(4, fy, cy, height)],
    shareOfArea: (fx * fy) / (width * height),
  };
}

/** Returns the parameters for an order by distance from a point, by default from the eye of the camera. */
export function distanceView(camera: Camera, origin: Vector3, eye: Vector3 = eyeOf(camera.worldToCamera)): OrderView {
  return { ...orderView(camera, origin), point: subtract(eye, origin) };
}

export const isSameView = (a: OrderView, b: OrderView): boolean =>
  a.point || b.point
    ? isSamePlace(a.point, b.point)
    : a.offset === b.offset &&
      a.near === b.near &&
      a.far === b.far &&
      isSamePlace(a.axis, b.axis) &&
      a.levels?.allowed === b.levels?.allowed &&
      (a.levels === b.levels || isSamePlace(a.levels?.eye, b.levels?.eye));

/** Whether two views also show the same part of the scene, so that splats cover the image equally in both. */
export const isSameImage = (a: OrderView, b: OrderView): boolean =>
  isSameView(a, b) &&
  Object.is(a.shareOfArea, b.shareOfArea) &&
  a.across.every((row, i) => row.every((value, k) => Object.is(value, b.across[i][k])));

const isSamePlace = (a: Vector3 | undefined, b: Vector3 | undefined): boolean =>
  a !== undefined && b !== undefined && a.every((value, i) => value === b[i]);

/** Fraction of the image below which a splat is counted without a test whether it is in the image. */
const SMALL_SHARE = 1 / 64;

/** Number of values of a digit: half of the bits of a float32. */
const DIGITS = 1 << 16;

/**
 * Stable radix sort by the exact float32 depth, in two passes of 16 bits. The bits of positive float32 numbers are
 * monotonic.
 */
export class SplatOrder {
  /** Coverage of the image by the splats of the last order, as a multiple of the image; computed from their areas. */
  covered = 0;
  /** [ceil(N / 256), 12] levels of detail of the splats: see `packWithDetail`; undefined without levels. */
  details: Float32Array | undefined;
  readonly #positions: Float32Array;
  readonly #areas: Float32Array | undefined;
  readonly #keys: Uint32Array;
  /** The memory of the keys. */
  readonly #depths: Float32Array;
  readonly #listed: Uint32Array;
  readonly #halfSorted: Uint32Array;
  readonly #low = new Uint32Array(DIGITS);
  readonly #high = new Uint32Array(DIGITS);

  /**
   * @param positions [N, 3] positions of the splats
   * @param areas [N] areas of the largest cross sections, in squared units of the positions; undefined for a coverage
   * of 0.
   */
  constructor(positions: Float32Array, areas?: Float32Array) {
    this.#areas = areas;
    const count = positions.length / 3;
    this.#positions = positions;
    this.#keys = new Uint32Array(count);
    this.#depths = new Float32Array(this.#keys.buffer);
    this.#listed = new Uint32Array(count);
    this.#halfSorted = new Uint32Array(count);
  }

  /** Replaces some splats, and some rows of {@link details}. */
  replace(update: SplatUpdate): void {
    for (const { at, numbers } of update.positions) this.#positions.set(numbers, at);
    for (const { at, numbers } of update.details) this.details?.set(numbers, at);
  }

  /**
   * Lists the splats of one or several scenes from near to far.
   * @param given View of each scene, in the order of their splats. An order by distance is that of one scene.
   * @param target Receives the indices; at least N elements.
   * @returns Number of listed splats.
   */
  sort(given: OrderView | readonly OrderView[], target: Uint32Array): number {
    const views = [given].flat();
    const [view] = views;
    const count = view.point ? this.#findDistances(view.point) : this.#findKeys(views);
    this.covered = this.#areas ? this.#sumShares(view, count, this.#areas) : 0;
    const [keys, listed, halfSorted] = [this.#keys, this.#listed, this.#halfSorted];
    startPlaces(this.#low);
    startPlaces(this.#high);
    for (let k = 0; k < count; k++) {
      const i = listed[k];
      halfSorted[this.#low[keys[i] & 0xffff]++] = i;
    }
    for (let k = 0; k < count; k++) {
      const i = halfSorted[k];
      target[this.#high[keys[i] >>> 16]++] = i;
    }
    return count;
  }

  /** Returns the coverage of the image by the listed splats, as a multiple of the image. */
  #sumShares({ axis, offset, near, far, ...view }: OrderView, count: number, areas: Float32Array): number {
    const { across, shareOfArea, isParallel } = view;
    const [x, y, z] = axis;
    const positions = this.#positions;
    let sum = 0;
    for (let k = 0; k < count; k++) {
      const i = this.#listed[k];
      const distance = x * positions[3 * i] + y * positions[3 * i + 1] + z * positions[3 * i + 2] + offset;
      // An order by distance also lists the splats behind the camera.
      if (!(distance >= near && distance <= far)) continue;
      const depth = isParallel ? 1 : distance;
      const share = (shareOfArea * areas[i]) / (depth * depth);
      if (share < SMALL_SHARE || this.#isWithin(across, positions, i, depth, share)) sum += Math.min(1, share || 0);
    }
    return sum;
  }

  /** Whether the center of a splat is in the image, or near enough for the splat to reach the image. */
  #isWithin(across: OrderView['across'], positions: Float32Array, i: number, depth: number, share: number): boolean {
    const [p, q, r] = [positions[3 * i], positions[3 * i + 1], positions[3 * i + 2]];
    const reach = 1 + 2 * Math.sqrt(share);
    return across.every(([x, y, z, o, c]) => Math.abs((x * p + y * q + z * r + o) / depth + c) <= reach);
  }

  /**
   * Computes the keys and indices of the splats within the range of depths, and a histogram of each digit. Returns the
   * number of these splats.
   */
  #findKeys(views: readonly OrderView[]): number {
    this.#low.fill(0);
    this.#high.fill(0);
    let count = 0;
    for (const [k, view] of views.entries()) {
      const [first, end] = [view.first ?? 0, views[k + 1]?.first ?? this.#keys.length];
      const drawn = view.levels && this.details && drawnChunks(this.details, first, end, view.levels);
      if (drawn) for (const [from, to] of drawn) count = this.#addKeys(view, from, to, count);
      else count = this.#addKeys(view, first, end, count);
    }
    return count;
  }

  /** Does the same for the splats from `first` to `end`, after `count` listed splats. */
  #addKeys({ axis: [x, y, z], offset, near, far }: OrderView, first: number, end: number, count: number): number {
    const [positions, keys, listed, low, high] = [this.#positions, this.#keys, this.#listed, this.#low, this.#high];
    const depths = this.#depths;
    for (let i = first, at = 3 * first; i < end; i++, at += 3) {
      const depth = x * positions[at] + y * positions[at + 1] + z * positions[at + 2] + offset;
      if (!(depth >= near && depth <= far)) continue;
      depths[i] = depth;
      low[keys[i] & 0xffff]++;
      high[keys[i] >>> 16]++;
      listed[count++] = i;
    }
    return count;
  }

  /**
   * Computes the keys (squared distances from a point) and indices of all splats, and a histogram of each digit.
   * Returns the number of splats.
   */
  #findDistances([x, y, z]: Vector3): number {
    const [positions, keys, listed, low, high] = [this.#positions, this.#keys, this.#listed, this.#low, this.#high];
    const distances = new Float32Array(keys.buffer);
    low.fill(0);
    high.fill(0);
    let count = 0;
    for (let i = 0, at = 0; i < keys.length; i++, at += 3) {
      const dx = positions[at] - x;
      const dy = positions[at + 1] - y;
      const dz = positions[at + 2] - z;
      const squared = dx * dx + dy * dy + dz * dz;
      if (!(squared < Infinity)) continue;
      distances[i] = squared;
      low[keys[i] & 0xffff]++;
      high[keys[i] >>> 16]++;
      listed[count++] = i;
    }
    return count;
  }
}

/** Converts a histogram of digits in place to the start index of each digit. */
function startPlaces(counts: Uint32Array): void {
  let sum = 0;
  for (let digit = 0; digit < DIGITS; digit++) {
    const count = counts[digit];
    counts[digit] = sum;
    sum += count;
  }
}
