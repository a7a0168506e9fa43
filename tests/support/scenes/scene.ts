/** What every procedural scene is made of. */
import { DEFAULT_FAR, DEFAULT_NEAR, lookAt, type Camera, type GaussianCloud, type Vector3 } from '@gaussian-splat/core';

export interface Scene {
  readonly name: string;
  readonly cloud: GaussianCloud;
  /** At least one. */
  readonly cameras: readonly Camera[];
}

/** Up in the picture: y points down in the frame of clouds. */
export const UP: Vector3 = [0, -1, 0];

/** The same view at another width, in pixels: a fraction of the work where a test is not about pixels. */
export function resized(camera: Camera, width: number): Camera {
  const s = width / camera.width;
  const height = Math.round(camera.height * s);
  return { ...camera, width, height, fx: camera.fx * s, fy: camera.fy * s, cx: camera.cx * s, cy: camera.cy * s };
}

/** A camera of the given size and horizontal field of view that looks from one point to another. */
export function cameraAt(
  eye: Vector3,
  target: Vector3,
  options: {
    readonly width?: number;
    readonly height?: number;
    readonly fovXDegrees?: number;
    readonly near?: number;
  } = {},
): Camera {
  const { width = 480, height = 320, fovXDegrees = 70, near = DEFAULT_NEAR } = options;
  const focal = width / 2 / Math.tan((fovXDegrees * Math.PI) / 360);
  return {
    width,
    height,
    fx: focal,
    fy: focal,
    cx: width / 2,
    cy: height / 2,
    worldToCamera: lookAt(eye, target, UP),
    near,
    far: DEFAULT_FAR,
  };
}
