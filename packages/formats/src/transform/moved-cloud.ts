import type { GaussianCloud } from '@gaussian-splat/core';
import { transformCloud } from './transform-cloud.js';

/** Maximum number of splats that are sampled for the center of a cloud. */
const SAMPLES = 4096;

/**
 * Whether a transform translates by 1,000 units or more along an axis, as in georeferenced scenes. Float32 would then
 * round positions by more than a few hundredths of a millimeter.
 * @param map Row-major, [3, 4].
 */
export const isFar = (map: readonly number[]): boolean => [3, 7, 11].some((k) => Math.abs(map[k]) >= 1_000);

/**
 * Applies an affine transform to a cloud. The arrays of the cloud are modified. If the cloud has an origin or moves far,
 * the center of its splats becomes the origin of the result, so that positions keep their precision.
 * @param map Row-major, [3, 4]: linear part and translation.
 * @returns The same cloud, or a new object with the same arrays and another origin.
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
  // Relative to the new origin, the center of the splats is (0, 0, 0).
  const shift = [0, 4, 8].map((row) => map[row + 3] - place(local, row));
  transformCloud(
    cloud,
    map.map((value, k) => (k % 4 === 3 ? shift[k >> 2] : value)),
  );
  return { ...cloud, origin: moved };
}

/** Returns the median of sampled coordinates along an axis. Unlike a mean, it is robust to unusable splats. */
function middleOf({ positions, count }: GaussianCloud, axis: number): number {
  const step = 3 * Math.ceil(count / SAMPLES);
  const sample: number[] = [];
  for (let k = axis; k < positions.length; k += step) if (Number.isFinite(positions[k])) sample.push(positions[k]);
  return sample.sort((a, b) => a - b)[sample.length >> 1] ?? 0;
}
