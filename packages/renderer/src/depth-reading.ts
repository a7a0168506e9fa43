import type { Camera } from '@gaussian-splat/core';

/** What `device` depth means: values from one plane of a projection to the other. */
export interface DepthPlanes {
  /** True if values are 1 at the near plane and 0 at the far one. */
  readonly reversed?: boolean | undefined;
  /** Planes of the host's projection, world units; default: the camera's. `far` may be Infinity. */
  readonly near?: number | undefined;
  readonly far?: number | undefined;
}

/** How stored values become camera depths: the fields of the WGSL `SceneDepth`. */
export function deviceReading(
  { reversed = false, near, far }: DepthPlanes,
  camera: Camera,
): { inverse: number[]; nothing: number } {
  const planes = [near ?? camera.near, far ?? camera.far];
  // From 0 at one plane to 1 at the other.
  const [from, to] = reversed ? planes.reverse() : planes;
  const nothing = reversed ? 0 : 1;
  if (camera.orthographic) return { inverse: [to - from, from, 0, 1], nothing };
  // 1 / depth is linear.
  const [a, b] = [1 / from, 1 / to];
  return { inverse: [0, 1, b - a, a], nothing };
}
