/** Cameras of a file that a command takes with `--views`. */
import { cameraFromCalibration, multiply } from '@gaussian-splat/core';
import { dealOwnViews } from '@gaussian-splat/optimize';
import { UsageError } from './command.mjs';
import { readJson } from './input-file.mjs';

/** Returns the views of a file `{views: [{width, height, K, worldToCamera}, ...]}`. */
export function parseViews(path) {
  const views = readJson(path)?.views;
  if (Array.isArray(views)) return views;
  throw new UsageError(
    `--views: expected {views: [{width, height, K, worldToCamera}, ...]}, found no list "views" in ${path}`,
  );
}

/** Maximum side of a view in pixels, as in training. Larger images need gigabytes, or exceed limits of the GPU. */
const MAX_SIDE = 1600;

/** Returns a camera with a reduced resolution if a side exceeds {@link MAX_SIDE}; otherwise the same camera. */
function scaledToMaxSide(camera) {
  const share = MAX_SIDE / Math.max(camera.width, camera.height);
  if (share >= 1) return camera;
  const [width, height] = [camera.width, camera.height].map((side) => Math.max(1, Math.round(share * side)));
  const [x, y] = [width / camera.width, height / camera.height];
  return { ...camera, width, height, fx: x * camera.fx, fy: y * camera.fy, cx: x * camera.cx, cy: y * camera.cy };
}

/**
 * Divides the views of a file by their purpose. Throws UsageError for fewer than 8 views.
 * @param rotation Rotation of the scene, row-major 3 x 3, if its splats were rotated after reading.
 */
export function dealViews(views, path, rotation) {
  const cameras = views.map((view, k) => rotated(cameraFromCalibration(view, `${path}, view ${k}`), rotation));
  const drawn = cameras.map(scaledToMaxSide);
  const smaller = drawn.filter((camera, k) => camera !== cameras[k]).length;
  if (smaller > 0) console.log(`views        ${smaller} of ${views.length} in fewer pixels, ${MAX_SIDE} a side`);
  const dealt = dealOwnViews(drawn);
  if (dealt.heldOut.length > 0) return { dealt, range: `of ${path} and between them` };
  throw new UsageError(`${path}: expected 8 views or more to make files with, found ${views.length}`);
}

/** Returns a camera that sees the rotated scene as the given camera sees the scene. */
function rotated(camera, rotation) {
  if (rotation === undefined) return camera;
  const [a, b, c, d, e, f, g, h, i] = rotation;
  const back = [a, d, g, 0, b, e, h, 0, c, f, i, 0, 0, 0, 0, 1];
  return { ...camera, worldToCamera: multiply(camera.worldToCamera, back) };
}
