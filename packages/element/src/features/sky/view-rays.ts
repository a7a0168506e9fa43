/** Directions of the rays through pixels in viewer space, with which a sky is sampled. */
import type { Camera } from '@gaussian-splat/core';
import type { ViewerFrame } from '../../viewer/camera/orbit.js';

/**
 * Focal length, in image heights, of the sky behind an orthographic camera: a field of view of 45 degrees. Parallel
 * rays would all sample the same point.
 */
const PARALLEL_FOCAL = 1 / (2 * Math.tan(Math.PI / 8));

/**
 * Returns three vectors of four numbers: factors of a pixel's x, its y, and 1. Their sum is the direction of the
 * pixel's ray, not normalized. The fourth numbers are unused.
 */
export function viewRays(camera: Camera, frame: ViewerFrame): Float32Array<ArrayBuffer> {
  const { worldToCamera: m, height, orthographic } = camera;
  const [fx, fy] = orthographic ? [PARALLEL_FOCAL * height, PARALLEL_FOCAL * height] : [camera.fx, camera.fy];
  // The rows of the rotation are the axes of the camera in the world.
  const axis = (row: number): number[] =>
    frame.map((to) => to[0] * m[4 * row] + to[1] * m[4 * row + 1] + to[2] * m[4 * row + 2]);
  const [right, down, forward] = [axis(0), axis(1), axis(2)];
  const x = right.map((value) => value / fx);
  const y = down.map((value) => value / fy);
  const base = forward.map((value, k) => value - camera.cx * x[k] - camera.cy * y[k]);
  return Float32Array.from([...x, 0, ...y, 0, ...base, 0]);
}
