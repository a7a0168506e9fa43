import type { GaussianCloud } from '@gaussian-splat/core';

/** Number of splats of the scene for each splat of its preview. */
export const PREVIEW_STEP = 16;
/**
 * Returns a preview of a cloud: every {@link PREVIEW_STEP}-th splat, without view-dependent color, enlarged by
 * {@link sparse}.
 */
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
 * Enlarges the splats of a preview in place, and returns the cloud with `represented`. The factor is the square root of
 * {@link PREVIEW_STEP}, so that they cover the area of all splats of the scene.
 */
export function sparse<T extends GaussianCloud>(cloud: T): T {
  const factor = Math.sqrt(PREVIEW_STEP);
  for (let i = 0; i < cloud.scales.length; i++) cloud.scales[i] *= factor;
  return { ...cloud, hints: { ...cloud.hints, represented: PREVIEW_STEP } };
}
