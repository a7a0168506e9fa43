import type { Camera } from '@gaussian-splat/core';

/** What `device` depth means: values from one plane of a projection to the other. */
export interface DepthPlanes {
  /** True if values are 1 at the near plane and 0 at the far one. */
  readonly reversed?: boolean | undefined;
  /** Planes of the host's projection, world units; default: the camera's. `far` may be Infinity. */
  readonly near?: number | undefined;
  readonly far?: number | undefined;
}

/**
 * How stored values become camera depths: the fields of the WGSL `SceneDepth`.
 * @param range what is stored for the planes: glDepthRange
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
  // Depth, or for perspectives its reciprocal, is linear in what is stored.
  const [a, b] = camera.orthographic ? [from, to] : [1 / from, 1 / to];
  const slope = (b - a) / (high - low);
  const line = [slope, a - slope * low];
  return { inverse: camera.orthographic ? [...line, 0, 1] : [0, 1, ...line], nothing };
}
