import type { GaussianCloud, Vector3 } from '@gaussian-splat/core';

/** Number of positions that are sampled for the center and the extent of a cloud. */
const SAMPLE = 4096;
/**
 * Maximum distance of a cloud from its origin, in units of its own extent. At 16 a pixel is still accurate to
 * thousandths.
 */
const FAR = 16;

/**
 * Returns the cloud with its origin moved among its splats, in float64, if they lie far from it: a file may hold
 * float32 coordinates of a million, and a camera matrix in float32 would then round the whole image to their steps.
 * Clouds near their origin are returned unchanged.
 */
export function recentered(cloud: GaussianCloud): GaussianCloud {
  const columns = [0, 1, 2].map((axis) => sampleOf(cloud, axis));
  if (columns[0].length === 0) return cloud;
  const middle = columns.map((values) => values[values.length >> 1]);
  const extent = Math.max(...columns.map((values) => quantile(values, 0.9) - quantile(values, 0.1)));
  if (Math.max(...middle.map(Math.abs)) <= FAR * extent) return cloud;
  const { origin, positions } = cloud;
  return {
    ...cloud,
    origin: origin.map((x, axis) => x + middle[axis]) as unknown as Vector3,
    positions: positions.map((x, i) => x - middle[i % 3]),
  };
}

/** Finite coordinates along an axis, in ascending order. */
function sampleOf({ count, positions }: GaussianCloud, axis: number): Float64Array {
  const step = Math.max(1, Math.ceil(count / SAMPLE));
  const values: number[] = [];
  for (let i = 0; i < count; i += step) {
    const value = positions[3 * i + axis];
    if (Number.isFinite(value)) values.push(value);
  }
  return Float64Array.from(values).sort();
}

const quantile = (sorted: Float64Array, share: number): number => sorted[Math.floor(share * (sorted.length - 1))];
