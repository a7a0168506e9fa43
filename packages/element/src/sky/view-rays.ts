/** Directions of the pixels' rays in viewer space, which a sky is sampled with. */
import type { Camera } from '@gaussian-splat/core';
import type { ViewerFrame } from '../camera/orbit.js';

/** Focal length in image heights of a sky behind parallel rays, which would all meet one point of it: a field of view of 45 degrees. */
const PARALLEL_FOCAL = 1 / (2 * Math.tan(Math.PI / 8));

/** Three vectors of four numbers: what a pixel's x, y and 1 are multiplied by for its direction (not of length 1); the fourth numbers are unused. */
export function viewRays(camera: Camera, frame: ViewerFrame): Float32Array<ArrayBuffer> {
  const { worldToCamera: m, height, orthographic } = camera;
  const [fx, fy] = orthographic ? [PARALLEL_FOCAL * height, PARALLEL_FOCAL * height] : [camera.fx, camera.fy];
  // Rows of the rotation are the camera's axes in the world.
  const axis = (row: number): number[] =>
    frame.map((to) => to[0] * m[4 * row] + to[1] * m[4 * row + 1] + to[2] * m[4 * row + 2]);
  const [right, down, forward] = [axis(0), axis(1), axis(2)];
  const x = right.map((value) => value / fx);
  const y = down.map((value) => value / fy);
  const base = forward.map((value, k) => value - camera.cx * x[k] - camera.cy * y[k]);
  return Float32Array.from([...x, 0, ...y, 0, ...base, 0]);
}
