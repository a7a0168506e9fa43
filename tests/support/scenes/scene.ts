/** Parts of every procedural scene. */
import { DEFAULT_FAR, lookAt, type Camera, type GaussianCloud, type Vector3 } from '@gaussian-splat/core';

export interface Scene {
  readonly name: string;
  readonly cloud: GaussianCloud;
  /** At least one. */
  readonly cameras: readonly Camera[];
}

/** Up in the image: y points down in the frame of clouds. */
export const UP: Vector3 = [0, -1, 0];

/** The same view at another width, in pixels: a fraction of the work for tests that do not measure pixels. */
export function resized(camera: Camera, width: number): Camera {
  const s = width / camera.width;
  const height = Math.round(camera.height * s);
  return { ...camera, width, height, fx: camera.fx * s, fy: camera.fy * s, cx: camera.cx * s, cy: camera.cy * s };
}

/** The same scene of fewer splats, taken from all over it: a fraction of the work for tests that read every number. */
export function thinned({ name, cloud, cameras }: Scene, count: number): Scene {
  const step = Math.max(1, cloud.count / count);
  const kept = Math.min(count, cloud.count);
  const part = (values: Float32Array): Float32Array => {
    const width = values.length / cloud.count;
    const out = new Float32Array(width * kept);
    for (let i = 0; i < kept; i++) {
      const from = width * Math.floor(i * step);
      out.set(values.subarray(from, from + width), width * i);
    }
    return out;
  };
  const { positions, scales, rotations, opacities, sh } = cloud;
  return {
    name,
    cameras,
    cloud: {
      ...cloud,
      count: kept,
      positions: part(positions),
      scales: part(scales),
      rotations: part(rotations),
      opacities: part(opacities),
      sh: part(sh),
    },
  };
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
  const { width = 480, height = 320, fovXDegrees = 70, near = 0.2 } = options;
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
