/**
 * An order that keeps neighbors in space mostly adjacent: along the Z-order curve (Morton 1966), so that blocks of
 * consecutive splats are compact and can be culled as a whole.
 */
import { sortByKey } from './radix-sort.js';

/** Bits of each axis in a 32-bit code. */
const AXIS_BITS = [11, 11, 10] as const;
const SAMPLE = 4096;
/** A scene counts as made of planes or layers if this fraction of its splats has the same coordinate. */
const FLAT_SHARE = 0.01;
/** Minimum number of splats for reordering. */
const MIN_COUNT = 1024;

/**
 * A Z-order curve through a scene, fitted to a sample of its splats on each axis. The curve is logarithmic far out, so
 * a sample from a small part of the scene serves the whole scene.
 */
export type Curve = readonly Axis[];

/**
 * Returns the curve through the given splats. Undefined for a scene of planes, which keeps its order: its splats may
 * have equal depths, and those are blended in the order of the file.
 * @param positions [3 N] world units
 * @param kept Indices of splats; not changed.
 * @param samples Number of sampled splats.
 */
export function curveThrough(positions: Float32Array, kept: Uint32Array, samples = SAMPLE): Curve | undefined {
  if (kept.length < MIN_COUNT) return undefined;
  const axes = [0, 1, 2].map((axis) => sampleAxis(positions, kept, axis, samples));
  return axes.some(isFlat) ? undefined : axes;
}

/** Position of each of the splats `kept` on a curve, as a 32-bit code. */
export function codesAlong(curve: Curve, positions: Float32Array, kept: Uint32Array): Uint32Array {
  const codes = new Uint32Array(kept.length);
  for (let k = 0; k < kept.length; k++) codes[k] = mortonCode(positions, 3 * kept[k], curve);
  return codes;
}

/**
 * The given splats in the order of the curve through them; unchanged if they are few or lie in planes. Parameters as in
 * {@link curveThrough}.
 */
export function mortonOrder(positions: Float32Array, kept: Uint32Array): Uint32Array {
  const curve = curveThrough(positions, kept);
  return curve ? sortByKey(kept, codesAlong(curve, positions, kept)) : kept;
}

/**
 * Whether splats lie in planes or layers. Some of them share a coordinate, so they have equal depths for a camera along
 * its axis, and another order changes the image.
 * @param positions [3 N] world units
 * @param kept Indices of splats; default all.
 */
export function isOfPlanes(positions: Float32Array, kept: Uint32Array = spread(positions.length / 3)): boolean {
  return [0, 1, 2].some((axis) => isFlat(sampleAxis(positions, kept, axis)));
}

/** Evenly spaced sample indices over all splats. */
function spread(count: number): Uint32Array {
  const samples = Math.min(SAMPLE, count);
  return Uint32Array.from({ length: samples }, (_, k) => Math.floor((k * count) / samples));
}

/** A single splat shares its coordinate with no other. */
const isFlat = ({ largestTie, samples }: Axis): boolean => largestTie > Math.max(1, FLAT_SHARE * samples);

export interface Axis {
  readonly median: number;
  /** Median distance from the median, or 1 if that is 0. */
  readonly spread: number;
  /** Largest number of samples with one and the same coordinate. */
  readonly largestTie: number;
  readonly samples: number;
}

/** Statistics of an axis over a sample of the splats. */
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
 * Coordinates are compressed by asinh first: nearly linear in the dense part, logarithmic far out, so that a few
 * distant splats do not take the resolution from all others.
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
 * asinh, to within 0.06 and monotonic: its logarithm is read from the exponent and mantissa of a float32, linear
 * between powers of two.
 */
function squeezed(x: number): number {
  float[0] = Math.abs(x) + Math.sqrt(x * x + 1);
  const size = ((bits[0] - BIAS) / 2 ** 23) * Math.LN2;
  return x < 0 ? -size : size;
}

/** Spreads the lowest 11 bits of a number, two zeros after each. */
function spreadBits(cell: number): number {
  let x = cell & 0x7ff;
  x = (x | (x << 16)) & 0x070000ff;
  x = (x | (x << 8)) & 0x0700f00f;
  x = (x | (x << 4)) & 0x430c30c3;
  return (x | (x << 2)) & 0x49249249;
}
