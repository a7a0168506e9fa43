/**
 * Computes the cameras of a video's frames for programs without a browser, as `<gaussian-splat>` does for the same
 * attributes.
 */
import type { Camera } from '@gaussian-splat/core';
import type { RawAttributes } from './viewer/attributes.js';
import { readAttributes } from './viewer/element-attributes.js';
import type { SceneBounds } from './viewer/camera/settings.js';
import { CameraController } from './viewer/camera-controller.js';
import { frameCount, frameShares, pathOfList, turntable, type CameraPath } from './viewer/camera/camera-path.js';
import { fail } from './viewer/camera/camera-view.js';
import { readViews } from './viewer/camera/read-views.js';

export type { SceneBounds } from './viewer/camera/settings.js';

/** Path of the camera, and number and size of the frames along it. */
export interface PathRequest {
  /** Parsed JSON of a list of views, in the form of the attribute `views`. Default: one turn around the target. */
  readonly views?: unknown;
  /** Attributes of the element that place the camera. */
  readonly attributes?: Partial<Record<'cameraOrbit' | 'cameraTarget' | 'fieldOfView' | 'up', string>> & {
    readonly orthographic?: boolean;
  };
  /** Bounds of the scene in its own coordinates: `boundsOf` of its cloud, with the up direction of the file. */
  readonly bounds: SceneBounds;
  /** Width of a frame, pixels. */
  readonly width: number;
  readonly height: number;
  /** Frames per second, above 0. Not used if `frames` is given. */
  readonly frameRate: number;
  /** Duration of the video, seconds. Default: the duration of the path. */
  readonly seconds?: number;
  /** Number of frames of the whole video; takes precedence over `seconds`. */
  readonly frames?: number;
}

/**
 * Returns the camera of each frame, in order.
 * @throws GaussianSplatError `argument/camera` for malformed views or attributes.
 */
export function camerasAlong(request: PathRequest): Camera[] {
  const { attributes = {}, bounds, width, height, frameRate } = request;
  const { camera: settings } = readAttributes(attributes as RawAttributes, (sentence) => {
    throw fail('attributes', 'the grammar of the attribute', sentence);
  });
  const camera = new CameraController(settings, () => undefined);
  camera.setAspect(width / height);
  camera.frame(bounds);
  const path = pathOf(request, camera);
  const frames = request.frames ?? frameCount(request.seconds ?? path.seconds, frameRate);
  return frameShares(frames, path).map((share) => {
    camera.moveTo(path.at(share));
    return camera.view(width, height);
  });
}

function pathOf({ views }: PathRequest, camera: CameraController): CameraPath {
  if (views === undefined) return turntable(camera.goal);
  const path = pathOfList(readViews(views), camera.context);
  if (path === null) throw fail('views', 'at least one view', views);
  return path;
}
