/**
 * An order in which neighbours in space are mostly neighbours: along the Z-order curve (Morton 1966), so that blocks of
 * consecutive splats are compact and can be culled as a whole.
 */
import { sortByKey } from './radix-sort.js';

/** Bits of each axis in a 32-bit code. */
const AXIS_BITS = [11, 11, 10] as const;
const SAMPLE = 4096;
/** Share of splats with the very same coordinate from which a scene counts as made of planes or layers. */
const FLAT_SHARE = 0.01;
/** Splats that a scene needs before an order pays. */
const LEAST_COUNT = 1024;

/**
 * A Z-order curve through a scene, by what a sample of its splats says of each axis. The curve is logarithmic far out, so a sample from a small part of
 * the scene serves the whole of it.
 */
export type Curve = readonly Axis[];

/**
 * The curve through the given splats. Undefined for a scene of planes, which keeps its order: its splats may have equal depths, and those are blended in the
 * file's order.
 * @param positions [3 N] world units
 * @param kept indices of splats; not changed
 * @param samples number of splats that are looked at
 */
export function curveThrough(positions: Float32Array, kept: Uint32Array, samples = SAMPLE): Curve | undefined {
  if (kept.length < LEAST_COUNT) return undefined;
  const axes = [0, 1, 2].map((axis) => sampleAxis(positions, kept, axis, samples));
  return axes.some(isFlat) ? undefined : axes;
}

/** The place of each of the splats `kept` on a curve, a 32-bit code. */
export function codesAlong(curve: Curve, positions: Float32Array, kept: Uint32Array): Uint32Array {
  const codes = new Uint32Array(kept.length);
  for (let k = 0; k < kept.length; k++) codes[k] = mortonCode(positions, 3 * kept[k], curve);
  return codes;
}

/** The given splats along the curve through them; as they are if they are few or lie in planes. Parameters as of {@link curveThrough}. */
export function mortonOrder(positions: Float32Array, kept: Uint32Array): Uint32Array {
  const curve = curveThrough(positions, kept);
  return curve ? sortByKey(kept, codesAlong(curve, positions, kept)) : kept;
}

/**
 * Whether splats lie in planes or layers. Some of them share a coordinate, so a camera that looks along its axis finds them at equal depths,
 * and another order changes the image.
 * @param positions [3 N] world units
 * @param kept indices of splats; default all
 */
export function isOfPlanes(positions: Float32Array, kept: Uint32Array = spread(positions.length / 3)): boolean {
  return [0, 1, 2].some((axis) => isFlat(sampleAxis(positions, kept, axis)));
}

/** Numbers of those that are looked at, where all are there. */
function spread(count: number): Uint32Array {
  const samples = Math.min(SAMPLE, count);
  return Uint32Array.from({ length: samples }, (_, k) => Math.floor((k * count) / samples));
}

/** A splat alone shares nothing with another. */
const isFlat = ({ largestTie, samples }: Axis): boolean => largestTie > Math.max(1, FLAT_SHARE * samples);

export interface Axis {
  readonly median: number;
  /** Median distance from the median, 1 where that is 0. */
  readonly spread: number;
  /** How many of the sample have one and the same coordinate. */
  readonly largestTie: number;
  readonly samples: number;
}

/** What some of the splats say of an axis. */
export function sampleAxis(positions: Float32Array, kept: Uint32Array, axis: number, samples = SAMPLE): Axis {
  const count = Math.min(samples, kept.length);
  const sample = Float32Array.from({ length: count }, (_, k) => {
    const i = kept[Math.floor((k * kept.length) / count)];
    return positions[3 * i + axis];
  }).sort();
  const median = sample[count >> 1];
  const distances = sample.map((x) => Math.abs(x - median)).sort();
  let tie = 1;
  let largestTie = 1;
  for (let k = 1; k < count; k++) {
    tie = sample[k] === sample[k - 1] ? tie + 1 : 1;
    largestTie = Math.max(largestTie, tie);
  }
  return { median, spread: distances[count >> 1] || 1, largestTie, samples: count };
}

/**
 * Coordinates are squeezed by asinh first: nearly linear where most splats are, logarithmic far out, so that a few distant
 * splats do not take the resolution from all others.
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

/** asinh, to within 0.06 and always growing: its logarithm is read off the exponent and mantissa of a float32, straight between powers of two. */
function squeezed(x: number): number {
  float[0] = Math.abs(x) + Math.sqrt(x * x + 1);
  const size = ((bits[0] - BIAS) / 2 ** 23) * Math.LN2;
  return x < 0 ? -size : size;
}

/** The lowest 11 bits of a number, two zeros after each. */
function spreadBits(cell: number): number {
  let x = cell & 0x7ff;
  x = (x | (x << 16)) & 0x070000ff;
  x = (x | (x << 8)) & 0x0700f00f;
  x = (x | (x << 4)) & 0x430c30c3;
  return (x | (x << 2)) & 0x49249249;
}
