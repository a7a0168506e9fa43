/** Puts splats in order of depth, on a processor: WebGL has no compute shaders. No DOM and no GPU here, since a worker runs it. */
import { eyeOf, subtract, type Camera, type Vector3 } from '@gaussian-splat/core';

/** What an order depends on: the depth of a point p is axis · p + offset, or its distance from `point`. */
export interface OrderView {
  readonly axis: Vector3;
  readonly offset: number;
  /** Only splats whose depth is within this range are listed. */
  readonly near: number;
  readonly far: number;
  /** Where set, splats are in order of their distance from here, and all are listed: turning the camera changes nothing. */
  readonly point?: Vector3 | undefined;
}

/** The view of a camera, for positions relative to an origin. */
export function orderView({ worldToCamera: m, near, far }: Camera, origin: Vector3): OrderView {
  const axis: Vector3 = [m[8], m[9], m[10]];
  return { axis, offset: axis[0] * origin[0] + axis[1] * origin[1] + axis[2] * origin[2] + m[11], near, far };
}

/** The view of a camera in whose order splats lie by their distance from a point, by default from its eye. */
export function distanceView(camera: Camera, origin: Vector3, eye: Vector3 = eyeOf(camera.worldToCamera)): OrderView {
  return { ...orderView(camera, origin), point: subtract(eye, origin) };
}

export const isSameView = (a: OrderView, b: OrderView): boolean =>
  a.point || b.point
    ? isSamePlace(a.point, b.point)
    : a.offset === b.offset && a.near === b.near && a.far === b.far && isSamePlace(a.axis, b.axis);

const isSamePlace = (a: Vector3 | undefined, b: Vector3 | undefined): boolean =>
  a !== undefined && b !== undefined && a.every((value, i) => value === b[i]);

/** Values of a digit: half of a float32. */
const DIGITS = 1 << 16;

/**
 * A stable radix sort by the float32 depth, exactly: the bits of a positive float32 grow as it does. Two passes of 16 bits.
 */
export class SplatOrder {
  readonly #positions: Float32Array;
  readonly #keys: Uint32Array;
  readonly #listed: Uint32Array;
  readonly #halfSorted: Uint32Array;
  readonly #low = new Uint32Array(DIGITS);
  readonly #high = new Uint32Array(DIGITS);

  /** @param positions [N, 3] */
  constructor(positions: Float32Array) {
    const count = positions.length / 3;
    this.#positions = positions;
    this.#keys = new Uint32Array(count);
    this.#listed = new Uint32Array(count);
    this.#halfSorted = new Uint32Array(count);
  }

  /**
   * Lists the splats from near to far.
   * @param target [at least N]
   * @returns how many are listed
   */
  sort(view: OrderView, target: Uint32Array): number {
    const count = view.point ? this.#findDistances(view.point) : this.#findKeys(view);
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

  /** Keys of the splats within the range, their numbers, and how often each digit occurs. */
  #findKeys({ axis: [x, y, z], offset, near, far }: OrderView): number {
    const [positions, keys, listed, low, high] = [this.#positions, this.#keys, this.#listed, this.#low, this.#high];
    const depths = new Float32Array(keys.buffer);
    low.fill(0);
    high.fill(0);
    let count = 0;
    for (let i = 0, at = 0; i < keys.length; i++, at += 3) {
      const depth = x * positions[at] + y * positions[at + 1] + z * positions[at + 2] + offset;
      if (!(depth >= near && depth <= far)) continue;
      depths[i] = depth;
      low[keys[i] & 0xffff]++;
      high[keys[i] >>> 16]++;
      listed[count++] = i;
    }
    return count;
  }

  /** The same with the squared distance in place of the depth. Coordinates that are no numbers come last. */
  #findDistances([x, y, z]: Vector3): number {
    const [positions, keys, listed, low, high] = [this.#positions, this.#keys, this.#listed, this.#low, this.#high];
    const distances = new Float32Array(keys.buffer);
    low.fill(0);
    high.fill(0);
    for (let i = 0, at = 0; i < keys.length; i++, at += 3) {
      const dx = positions[at] - x;
      const dy = positions[at + 1] - y;
      const dz = positions[at + 2] - z;
      distances[i] = dx * dx + dy * dy + dz * dz;
      low[keys[i] & 0xffff]++;
      high[keys[i] >>> 16]++;
      listed[i] = i;
    }
    return keys.length;
  }
}

/** From how often digits occur to where the first of each goes. */
function startPlaces(counts: Uint32Array): void {
  let sum = 0;
  for (let digit = 0; digit < DIGITS; digit++) {
    const count = counts[digit];
    counts[digit] = sum;
    sum += count;
  }
}
