import { quaternionOfMatrix, shCoefficientCount, symmetricEigen, type GaussianCloud } from '@gaussian-splat/core';
import { leafLevel, levelOf, levelsAbove, packedOrder, type SplatLevel } from '@gaussian-splat/renderer/tools';

/** Ratio of the splats of two levels of detail. */
const LEVEL = 4;

/**
 * Returns a cloud of at most `max` splats, without a GPU: near neighbors are merged as in levels of detail, which keeps
 * their moments and the area that they cover. Unusable splats are left out. Returns the cloud itself if it is small enough.
 * @param max Whole number, at least 1.
 */
export function fewerSplats(cloud: GaussianCloud, max: number): GaussianCloud {
  if (cloud.count <= max) return cloud;
  let level = leafLevel(cloud, packedOrder(cloud));
  while (level.count > LEVEL * max) [level] = levelsAbove(level, 1);
  return cloudOf([level.count > max ? levelOf(level, max) : level], cloud);
}

/** Concatenates levels to one cloud. Merged splats may have opacities above 1, which become 1. */
export function cloudOf(levels: readonly SplatLevel[], like: GaussianCloud): GaussianCloud {
  const count = levels.reduce((sum, level) => sum + level.count, 0);
  const [positions, scales] = [new Float32Array(3 * count), new Float32Array(3 * count)];
  const [rotations, opacities] = [new Float32Array(4 * count), new Float32Array(count)];
  const stride = 3 * shCoefficientCount(like.shDegree);
  const sh = new Float32Array(stride * count);
  let at = 0;
  for (const level of levels) {
    positions.set(level.positions, 3 * at);
    level.readSh(0, level.count, sh.subarray(stride * at));
    for (let i = 0; i < level.count; i++, at++) {
      const { values, vectors } = symmetricEigen(covarianceOf(level.factors, 6 * i));
      for (let n = 0; n < 3; n++) scales[3 * at + n] = Math.sqrt(Math.max(MIN_VARIANCE, values[n]));
      rotations.set(quaternionOfMatrix(vectors), 4 * at);
      opacities[at] = Math.min(1, level.opacities[i]);
    }
  }
  return { ...like, count, positions, scales, rotations, opacities, sh };
}

/** Minimum variance in world units², whose square root float32 can hold. */
const MIN_VARIANCE = 1e-36;

/**
 * Returns the row-major 3x3 covariance of a splat.
 * @param factors Lower triangular roots of covariances: xx, yx, yy, zx, zy, zz.
 * @param at Index of the splat's first factor.
 */
function covarianceOf(factors: Float32Array, at: number): number[] {
  const [xx, yx, yy, zx, zy, zz] = factors.subarray(at, at + 6);
  const [xy, xz, yz] = [xx * yx, xx * zx, yx * zx + yy * zy];
  return [xx * xx, xy, xz, xy, yx * yx + yy * yy, yz, xz, yz, zx * zx + zy * zy + zz * zz];
}
