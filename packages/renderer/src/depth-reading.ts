import type { Camera } from '@gaussian-splat/core';

/** Meaning of `device` depth: values between the near and the far plane of a projection. */
export interface DepthPlanes {
  /** Whether values are 1 at the near plane and 0 at the far plane. */
  readonly reversed?: boolean | undefined;
  /** Planes of the host's projection in world units; default: those of the camera. `far` may be Infinity. */
  readonly near?: number | undefined;
  readonly far?: number | undefined;
}

/**
 * Conversion of stored values to camera depths: the fields of the WGSL `SceneDepth`.
 * @param range Stored values at the planes: glDepthRange.
 */
export function deviceReading(
  { reversed = false, near, far }: DepthPlanes,
  camera: Camera,
  [low, high]: readonly [number, number] = [0, 1],
): { inverse: number[]; nothing: number } {
  const planes = [near ?? camera.near, far ?? camera.far];
  // From 0 at one plane to 1 at the other.
  const [from, to] = reversed ? planes.reverse() : planes;
  const nothing = reversed ? 0 : 1;
  // Depth, or its reciprocal for perspective cameras, is linear in the stored value.
  const [a, b] = camera.orthographic ? [from, to] : [1 / from, 1 / to];
  const slope = (b - a) / (high - low);
  const line = [slope, a - slope * low];
  return { inverse: camera.orthographic ? [...line, 0, 1] : [0, 1, ...line], nothing };
}
