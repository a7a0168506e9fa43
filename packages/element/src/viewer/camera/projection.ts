/** Converts between points of the scene and pixels of a frame. */
import type { Camera, Vector3 } from '@gaussian-splat/core';

/** Position of a scene point in a frame. */
export interface Projected {
  /** Pixels from the left edge of the frame. */
  readonly x: number;
  readonly y: number;
  /**
   * World units along the optical axis. Points with a depth of 0 or less are behind the camera; their x and y are
   * meaningless.
   */
  readonly depth: number;
}

/** Returns pixels and depth of a point in scene coordinates. */
export function project({ worldToCamera: m, fx, fy, cx, cy, orthographic }: Camera, [x, y, z]: Vector3): Projected {
  const row = (r: number): number => m[4 * r] * x + m[4 * r + 1] * y + m[4 * r + 2] * z + m[4 * r + 3];
  const depth = row(2);
  const shrink = orthographic ? 1 : depth;
  return { x: (fx * row(0)) / shrink + cx, y: (fy * row(1)) / shrink + cy, depth };
}

/** Returns the point in scene coordinates at a pixel and depth: the inverse of {@link project}. */
export function unproject(camera: Camera, { x, y, depth }: Projected): Vector3 {
  const { worldToCamera: m, fx, fy, cx, cy, orthographic } = camera;
  const stretch = orthographic ? 1 : depth;
  const inCamera = [(stretch * (x - cx)) / fx - m[3], (stretch * (y - cy)) / fy - m[7], depth - m[11]];
  // The matrix is a rotation and a translation, so its transpose inverts directions.
  const column = (c: number): number => m[c] * inCamera[0] + m[4 + c] * inCamera[1] + m[8 + c] * inCamera[2];
  return [column(0), column(1), column(2)];
}
