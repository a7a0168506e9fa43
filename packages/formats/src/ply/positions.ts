import type { Vector3 } from '@gaussian-splat/core';

/** Positions [N, 3] in float32, relative to an origin in float64. */
export interface RelativePositions {
  readonly origin: Vector3;
  readonly positions: Float32Array;
}

/** Maximum number of splats that are sampled for the origin. */
const SAMPLE_LIMIT = 16_384;

/**
 * Splits positions into a float64 origin and float32 positions relative to it, so that float32 keeps the detail of
 * scenes far from (0, 0, 0), such as georeferenced ones. The origin is (0, 0, 0) if float32 represents every coordinate
 * exactly.
 * @param world [N, 3] positions.
 */
export function relativePositions(world: Float64Array): RelativePositions {
  const isExact = world.every((value) => Math.fround(value) === value || !Number.isFinite(value));
  const origin: Vector3 = isExact ? [0, 0, 0] : [medianOf(world, 0), medianOf(world, 1), medianOf(world, 2)];
  const positions = new Float32Array(world.length);
  for (let i = 0; i < world.length; i++) positions[i] = world[i] - origin[i % 3];
  return { origin, positions };
}

/** Returns the median of one axis from a sample. Unlike a mean, it is robust to outliers. */
function medianOf(world: Float64Array, axis: number): number {
  const step = 3 * Math.max(1, Math.ceil(world.length / 3 / SAMPLE_LIMIT));
  const sample: number[] = [];
  for (let i = axis; i < world.length; i += step) {
    if (Number.isFinite(world[i])) sample.push(world[i]);
  }
  sample.sort((a, b) => a - b);
  return sample[sample.length >> 1] ?? 0;
}
