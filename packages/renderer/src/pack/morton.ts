/**
 * Orders splats along the Z-order curve (Morton 1966), which keeps neighbors in space mostly adjacent. Runs of
 * consecutive splats are therefore compact, and can be culled as a whole.
 */
import { sortByKey } from './radix-sort.js';

/** Number of bits of each axis in a 32-bit code. */
const AXIS_BITS = [11, 11, 10] as const;
const SAMPLE = 4096;
/** Minimum fraction of splats with the same coordinate in a scene that counts as made of planes or layers. */
const FLAT_SHARE = 0.01;
/** Minimum number of splats that are reordered. */
const MIN_COUNT = 1024;

/**
 * A Z-order curve through a scene, fitted to a sample of its splats on each axis. The curve is logarithmic far from the
 * center, so that a sample from a small part of the scene suffices for the whole scene.
 */
export type Curve = readonly Axis[];

/**
 * Returns the curve through the given splats. Undefined for fewer than 1,024 splats, and for a scene of planes. Such a
 * scene keeps its order: its splats may have equal depths, and are then blended in the order of the file.
 * @param positions [3 N] world units
 * @param kept Indices of splats; not changed.
 */
export function curveThrough(positions: Float32Array, kept: Uint32Array): Curve | undefined {
  if (kept.length < MIN_COUNT) return undefined;
  const axes = [0, 1, 2].map((axis) => sampleAxis(positions, kept, axis));
  return axes.some(isFlat) ? undefined : axes;
}

/** Returns the position on a curve of each splat in `kept`, as a 32-bit code. */
export function codesAlong(curve: Curve, positions: Float32Array, kept: Uint32Array): Uint32Array {
  const codes = new Uint32Array(kept.length);
  for (let k = 0; k < kept.length; k++) codes[k] = mortonCode(positions, 3 * kept[k], curve);
  return codes;
}

/**
 * Returns the given splats in the order of the curve through them; unchanged if they are few or are in planes.
 * Parameters as in {@link curveThrough}.
 */
export function mortonOrder(positions: Float32Array, kept: Uint32Array): Uint32Array {
  const curve = curveThrough(positions, kept);
  return curve ? sortByKey(kept, codesAlong(curve, positions, kept)) : kept;
}

/**
 * Whether splats are in planes or layers. Many of them then share a coordinate, and have equal depths for a camera
 * along its axis: another order would change the image.
 * @param positions [3 N] world units
 */
export function isOfPlanes(positions: Float32Array): boolean {
  const kept = spread(positions.length / 3);
  return [0, 1, 2].some((axis) => isFlat(sampleAxis(positions, kept, axis)));
}

/** Returns up to {@link SAMPLE} evenly spaced indices from 0 to `count` - 1. */
function spread(count: number): Uint32Array {
  const samples = Math.min(SAMPLE, count);
  return Uint32Array.from({ length: samples }, (_, k) => Math.floor((k * count) / samples));
}

/** Whether too many sampled splats share one coordinate. A tie of 1 does not count: it is a single splat. */
const isFlat = ({ largestTie, samples }: Axis): boolean => largestTie > Math.max(1, FLAT_SHARE * samples);

/** Statistics of the coordinates of splats on one axis. */
export interface Axis {
  readonly median: number;
  /** Median distance of the coordinates from `median`; 1 if that is 0. */
  readonly spread: number;
  /** Largest number of samples that have the same coordinate. */
  readonly largestTie: number;
  readonly samples: number;
}

/** Returns the statistics of an axis, 0 to 2, over a sample of the splats in `kept`. */
export function sampleAxis(positions: Float32Array, kept: Uint32Array, axis: number): Axis {
  const count = Math.min(SAMPLE, kept.length);
  const sample = new Float32Array(count);
  for (let k = 0; k < count; k++) sample[k] = positions[3 * kept[Math.floor((k * kept.length) / count)] + axis];
  sample.sort();
  const middle = count >> 1;
  const median = sample[middle];
  let tie = 1;
  let largestTie = 1;
  for (let k = 1; k < count; k++) {
    tie = sample[k] === sample[k - 1] ? tie + 1 : 1;
    largestTie = Math.max(largestTie, tie);
  }
  // Distances from the median grow on both sides of it. The nearest ones are taken, up to the median distance.
  let [below, above, distance] = [middle - 1, middle, 0];
  for (let k = 0; k <= middle && count > 0; k++) {
    const isBelow = above >= count || (below >= 0 && median - sample[below] < sample[above] - median);
    distance = isBelow ? median - sample[below--] : sample[above++] - median;
  }
  return { median, spread: Math.fround(distance) || 1, largestTie, samples: count };
}

/**
 * Returns the 32-bit code of the position at index `at`. Coordinates are first compressed by asinh: nearly linear in
 * the dense part, logarithmic far from it. A few distant splats therefore do not reduce the resolution for all others.
 */
function mortonCode(positions: Float32Array, at: number, axes: readonly Axis[]): number {
  let code = 0;
  for (let axis = 0; axis < 3; axis++) {
    const { median, spread } = axes[axis];
    const steps = 1 << AXIS_BITS[axis];
    const cell = Math.floor((squeezed((positions[at + axis] - median) / (2 * spread)) / 4 + 1) * 0.5 * steps);
    code |= spreadBits(Math.min(steps - 1, Math.max(0, cell))) << axis;
  }
  return code >>> 0;
}

const float = new Float32Array(1);
const bits = new Uint32Array(float.buffer);
const BIAS = 127 * 2 ** 23;

/**
 * Returns asinh of a number to within 0.06. The function is monotonic: its logarithm is read from the exponent and
 * mantissa of a float32, and is linear between powers of two.
 */
function squeezed(x: number): number {
  float[0] = Math.abs(x) + Math.sqrt(x * x + 1);
  const size = ((bits[0] - BIAS) / 2 ** 23) * Math.LN2;
  return x < 0 ? -size : size;
}

/** Spreads the lowest 11 bits of a number, with two zeros after each. */
function spreadBits(cell: number): number {
  let x = cell & 0x7ff;
  x = (x | (x << 16)) & 0x070000ff;
  x = (x | (x << 8)) & 0x0700f00f;
  x = (x | (x << 4)) & 0x430c30c3;
  return (x | (x << 2)) & 0x49249249;
}
