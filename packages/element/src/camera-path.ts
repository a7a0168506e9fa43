/** Cameras of the frames of a video, for programs without a browser: those of `<gaussian-splat>` with the same attributes. */
import type { Camera } from '@gaussian-splat/core';
import { readAttributes, type RawAttributes } from './attributes.js';
import type { SceneBounds } from './camera/settings.js';
import { CameraController } from './controllers/camera-controller.js';
import { frameCount, frameShares, pathOfList, turntable, type CameraPath } from './views/camera-path.js';
import { fail } from './views/camera-view.js';
import { readViews } from './views/read-views.js';

export type { SceneBounds } from './camera/settings.js';

/** A path of the camera, and the frames along it. */
export interface PathRequest {
  /** Parsed JSON of a list of views, as the attribute `views` takes it. Default: one turn around the target. */
  readonly views?: unknown;
  /** Attributes of the element that place the camera. */
  readonly attributes?: Partial<Record<'cameraOrbit' | 'cameraTarget' | 'fieldOfView' | 'up', string>> & {
    readonly orthographic?: boolean;
  };
  /** Bounds of the scene in its own frame: `boundsOf` of its cloud, with the up direction of the file. */
  readonly bounds: SceneBounds;
  /** Pixels. */
  readonly width: number;
  readonly height: number;
  /** Frames in a second, above 0. */
  readonly frameRate: number;
  /** Default: what the path says. */
  readonly seconds?: number;
  /** Frames of the whole video; above `seconds`. */
  readonly frames?: number;
}

/**
 * The camera of each frame.
 * @throws GaussianSplatError `argument/camera` for views and attributes that are malformed.
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
