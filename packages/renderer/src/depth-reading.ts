import type { Camera } from '@gaussian-splat/core';

/** Near and far plane of the projection that defines `device` depth. */
export interface DepthPlanes {
  /** Whether values are 1 at the near plane and 0 at the far plane. */
  readonly reversed?: boolean | undefined;
  /** Near plane of the host's projection in world units; default: that of the camera. */
  readonly near?: number | undefined;
  /** Far plane of the host's projection in world units, or Infinity; default: that of the camera. */
  readonly far?: number | undefined;
}

/**
 * Returns the conversion of stored `device` values to camera depths, as fields of the WGSL `SceneDepth`: depth =
 * (`inverse[0]` · value + `inverse[1]`) / (`inverse[2]` · value + `inverse[3]`). `nothing` is the stored value without
 * a surface.
 * The last parameter contains the stored values at the two planes (glDepthRange); default: 0 and 1.
 */
export function deviceReading(
  { reversed = false, near, far }: DepthPlanes,
  camera: Camera,
  [low, high]: readonly [number, number] = [0, 1],
): { inverse: number[]; nothing: number } {
  const planes = [near ?? camera.near, far ?? camera.far];
  // Planes at the stored values `low` and `high`.
  const [from, to] = reversed ? planes.reverse() : planes;
  const nothing = reversed ? 0 : 1;
  // Depth, or its reciprocal for perspective cameras, is linear in the stored value.
  const [a, b] = camera.orthographic ? [from, to] : [1 / from, 1 / to];
  const slope = (b - a) / (high - low);
  const line = [slope, a - slope * low];
  return { inverse: camera.orthographic ? [...line, 0, 1] : [0, 1, ...line], nothing };
}
