import { eyeOf, inverse, multiply, normalize, subtract, type Camera, type Vector3 } from '@gaussian-splat/core';
import { constants, type layouts } from './generated/shaders.js';
import type { StructValues } from './gpu/struct.js';

/**
 * Margin by which the Jacobian's clamp exceeds the image, as a fraction of the half field of view. INRIA's factor 1.3
 * is 1 + this margin.
 */
const CLAMP_MARGIN = 0.3;

/**
 * Largest float32. It replaces an infinite far plane, because WGSL allows compilers to assume that there is no
 * infinity.
 */
export const MAX_FLOAT32 = 3.4028234663852886e38;

/** `View.max_covered` without a limit. */
const NO_LIMIT = 0xffffffff;

type ViewValues = StructValues<typeof layouts.View>;

/** The fields of the WGSL `View` that depend on the camera and on the origin of the Gaussians. */
export type CameraValues = Omit<
  ViewValues,
  | 'splat_count'
  | 'page'
  | 'first_group'
  | 'sh_degree'
  | 'sh_cap'
  | 'sh_encoding'
  | 'antialiased'
  | 'key_bits'
  | 'has_detail'
  | 'detail'
  | 'detail_fade'
  | 'splat_budget'
  | 'opacity'
  | 'crop_low'
  | 'crop_high'
>;

/**
 * Converts a camera to uniforms. The matrix contains the origin, combined in float64. Scenes a million units from the
 * world's origin therefore keep their float32 digits.
 * @param origin World position of the origin of the Gaussians.
 * @param variance Variance of the scene's low-pass filter, in px².
 */
export function cameraValues(camera: Camera, origin: Vector3, variance: number = constants.DILATION): CameraValues {
  const { width, height, fx, fy, cx, cy, near, far, worldToCamera, orthographic = false } = camera;
  const toOrigin = [1, 0, 0, origin[0], 0, 1, 0, origin[1], 0, 0, 1, origin[2], 0, 0, 0, 1];
  const rows = multiply(worldToCamera, toOrigin);
  const columns = Array.from({ length: 16 }, (_, i) => rows[4 * (i % 4) + Math.floor(i / 4)]);
  // The clamp has gsplat's form: asymmetric for an off-center principal point. For a centered one it equals INRIA's
  // ±1.3 tan(fov/2).
  const marginX = (CLAMP_MARGIN * 0.5 * width) / fx;
  const marginY = (CLAMP_MARGIN * 0.5 * height) / fy;
  const eye = subtract(eyeOf(worldToCamera), origin);
  return {
    max_covered: NO_LIMIT,
    local_to_camera: columns,
    eye,
    eye_rest: subtract(eye, [Math.fround(eye[0]), Math.fround(eye[1]), Math.fround(eye[2])]),
    focal: [fx, fy],
    principal: [cx, cy],
    viewport: [width, height],
    jacobian_min: orthographic ? [0, 0] : [-cx / fx - marginX, -cy / fy - marginY],
    jacobian_max: orthographic ? [0, 0] : [(width - cx) / fx + marginX, (height - cy) / fy + marginY],
    is_orthographic: orthographic ? 1 : 0,
    axis: axisOf(worldToCamera),
    near,
    far: Math.min(far, MAX_FLOAT32),
    stretch: stretchOf(worldToCamera),
    filter_variance: variance,
  };
}

/** Returns the unit vector of a camera's depth, in the coordinates that its matrix transforms. */
function axisOf(worldToCamera: Camera['worldToCamera']): Vector3 {
  const m = inverse(worldToCamera);
  return normalize([m[2], m[6], m[10]]);
}

/**
 * Returns an upper bound of the factor by which a matrix W lengthens vectors: the square root of the largest row sum of
 * |W Wᵀ|.
 */
function stretchOf(worldToCamera: ArrayLike<number>): number {
  const dot = (a: number, b: number): number =>
    worldToCamera[4 * a] * worldToCamera[4 * b] +
    worldToCamera[4 * a + 1] * worldToCamera[4 * b + 1] +
    worldToCamera[4 * a + 2] * worldToCamera[4 * b + 2];
  const rowSum = (a: number): number => Math.abs(dot(a, 0)) + Math.abs(dot(a, 1)) + Math.abs(dot(a, 2));
  return Math.sqrt(Math.max(rowSum(0), rowSum(1), rowSum(2)));
}

/**
 * Returns a camera of the same view with fewer pixels: `scale` is a factor of width and height, and neither becomes 0.
 */
export function scaled(camera: Camera, scale: number): Camera {
  if (scale === 1) return camera;
  return resized(camera, Math.max(1, Math.round(camera.width * scale)), Math.max(1, Math.round(camera.height * scale)));
}

/** Returns a camera of the same view with an image of another size. */
export function resized(camera: Camera, width: number, height: number): Camera {
  const [x, y] = [width / camera.width, height / camera.height];
  return { ...camera, width, height, fx: camera.fx * x, fy: camera.fy * y, cx: camera.cx * x, cy: camera.cy * y };
}
