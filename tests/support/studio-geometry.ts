/** Points of a studio's scene, their pixels, and whether a view shows them. */
import type { Camera, Vector3 } from '@gaussian-splat/core';
import type { StudioScene, StudioView } from './studio.js';

/** Returns the world point at a pixel of a camera, `depth` along its optical axis. */
export function pointAt({ worldToCamera: m, fx, fy, cx, cy }: Camera, x: number, y: number, depth: number): Vector3 {
  const p = [((x - cx) / fx) * depth - m[3], ((y - cy) / fy) * depth - m[7], depth - m[11]];
  const along = (k: number): number => m[k] * p[0] + m[4 + k] * p[1] + m[8 + k] * p[2];
  return [along(0), along(1), along(2)];
}

/** Returns the pixel of a world point, and its depth along the optical axis. */
export function seenAt(
  { worldToCamera: m, fx, fy, cx, cy }: Camera,
  p: Vector3,
): { readonly x: number; readonly y: number; readonly depth: number } {
  const [x, y, z] = [0, 1, 2].map((k) => m[4 * k] * p[0] + m[4 * k + 1] * p[1] + m[4 * k + 2] * p[2] + m[4 * k + 3]);
  return { x: (fx * x) / z + cx, y: (fy * y) / z + cy, depth: z };
}

/** Margin in pixels of the image in which points count as not visible. */
const MARGIN = 8;
/** Distance in meters of the reference's surface from a point that it shows. */
const ON_SURFACE = 0.04;

/** Whether nothing hides a point in a held-out view: the reference depth there is its own. */
export function isVisible(scene: StudioScene, view: StudioView, point: Vector3): boolean {
  const { x, y, depth } = seenAt(view.camera, point);
  const { width, height } = view.camera;
  if (depth < 0.3 || x < MARGIN || y < MARGIN || x > width - MARGIN || y > height - MARGIN) return false;
  const reference = scene.depths(view);
  const step = scene.truth.depth.everyPixel;
  const [column, row] = [Math.floor(x / step), Math.floor(y / step)];
  return [0, -1, 1].some((dx) =>
    [0, -1, 1].some((dy) => {
      const found = reference.depths[(row + dy) * reference.width + column + dx];
      return Math.abs(found - depth) < ON_SURFACE;
    }),
  );
}
