import type { GaussianCloud } from '@gaussian-splat/core';
import { transformCloud } from './transform-cloud.js';

/** Number of splats sampled for the center of a cloud. */
const SAMPLES = 4096;

/**
 * Whether float32 would round positions by more than a few hundredths of a millimeter after the translation of a map,
 * as in georeferenced scenes.
 */
export const isFar = (map: readonly number[]): boolean => [3, 7, 11].some((k) => Math.abs(map[k]) >= 1_000);

/**
 * Applies an affine map to a cloud, in place. Far from (0, 0, 0) the center of its splats becomes the origin, so that
 * they keep their precision.
 * @param map [3, 4], row-major: linear part and translation.
 */
export function applyMotion(cloud: GaussianCloud, map: readonly number[]): GaussianCloud {
  const { origin } = cloud;
  if ((!isFar(map) && origin.every((x) => x === 0)) || cloud.count === 0) {
    transformCloud(cloud, map);
    return cloud;
  }
  const local = [0, 1, 2].map((axis) => middleOf(cloud, axis));
  const place = (from: readonly number[], row: number): number =>
    map[row] * from[0] + map[row + 1] * from[1] + map[row + 2] * from[2] + map[row + 3];
  const world = local.map((x, axis) => x + origin[axis]);
  const moved = [place(world, 0), place(world, 4), place(world, 8)] as const;
  // The center moves to (0, 0, 0).
  const shift = [0, 4, 8].map((row) => map[row + 3] - place(local, row));
  transformCloud(
    cloud,
    map.map((value, k) => (k % 4 === 3 ? shift[k >> 2] : value)),
  );
  return { ...cloud, origin: moved };
}

/** Median of sampled coordinates along an axis, because unusable ones may have any value. */
function middleOf({ positions, count }: GaussianCloud, axis: number): number {
  const step = 3 * Math.ceil(count / SAMPLES);
  const sample: number[] = [];
  for (let k = axis; k < positions.length; k += step) if (Number.isFinite(positions[k])) sample.push(positions[k]);
  return sample.sort((a, b) => a - b)[sample.length >> 1] ?? 0;
}
