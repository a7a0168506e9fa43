import type { GaussianCloud } from '@gaussian-splat/core';

/** A preview contains one splat of this many. */
export const PREVIEW_STEP = 16;
/** Returns every n-th splat of a cloud, without coefficients above the constant one, enlarged to represent the rest. */
export function samplePreview(cloud: GaussianCloud): GaussianCloud {
  const count = Math.ceil(cloud.count / PREVIEW_STEP);
  const take = (values: Float32Array, stride: number, size: number): Float32Array => {
    const taken = new Float32Array(size * count);
    for (let i = 0; i < count; i++) {
      const from = stride * PREVIEW_STEP * i;
      for (let k = 0; k < size; k++) taken[size * i + k] = values[from + k];
    }
    return taken;
  };
  return sparse({
    ...cloud,
    count,
    positions: take(cloud.positions, 3, 3),
    scales: take(cloud.scales, 3, 3),
    rotations: take(cloud.rotations, 4, 4),
    opacities: take(cloud.opacities, 1, 1),
    sh: take(cloud.sh, cloud.sh.length / Math.max(1, cloud.count), 3),
    shDegree: 0,
  });
}

/**
 * Enlarges a selection of splats to represent the whole: each by the square root of the number that it represents, so
 * that they cover the same area. Works in place.
 */
export function sparse<T extends GaussianCloud>(cloud: T, share = 1 / PREVIEW_STEP): T {
  const factor = Math.sqrt(1 / share);
  for (let i = 0; i < cloud.scales.length; i++) cloud.scales[i] *= factor;
  return cloud;
}
