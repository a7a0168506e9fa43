import type { GaussianCloud } from '@gaussian-splat/core';

/** A preview has every so many-th splat. */
export const PREVIEW_STEP = 16;
/** Every n-th splat of a cloud, without coefficients above the constant one, larger to stand for the rest. */
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
 * Makes a selection stand for the whole: `kept` of `all` splats, each larger by the square root of what it stands for, so that they
 * cover the same area. Works in place.
 */
export function sparse<T extends GaussianCloud>(cloud: T, share = 1 / PREVIEW_STEP): T {
  const factor = Math.sqrt(1 / share);
  for (let i = 0; i < cloud.scales.length; i++) cloud.scales[i] *= factor;
  return cloud;
}
