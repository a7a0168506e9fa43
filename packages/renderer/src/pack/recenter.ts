import type { GaussianCloud, Vector3 } from '@gaussian-splat/core';

/** Number of positions that are sampled to find the center and the extent of a cloud. */
const SAMPLE = 4096;
/**
 * Maximum distance of a cloud from its origin, as a multiple of its own extent. At 16, float32 positions are still
 * accurate to thousandths of a pixel.
 */
const FAR = 16;

/**
 * Returns the cloud with its origin moved, in float64, into the middle of its splats if they are far from it. A file
 * may contain float32 coordinates of a million. A camera matrix in float32 would then round the whole image to their
 * steps. Clouds near their origin are returned unchanged.
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

/** Returns a sample of the finite coordinates along an axis, in ascending order. */
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
