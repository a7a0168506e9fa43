import type { Camera } from '@gaussian-splat/core';
import type { CameraAxes, MatrixOrder } from '@gaussian-splat/core/contract';
import { inverse, multiply } from '@gaussian-splat/core';

/** Returns the factors, 1 or -1, that convert OpenCV's camera axes (right, down, forward) to the declared ones. */
function axisSigns(axes: CameraAxes): readonly [number, number, number] {
  return [axes[0] === 'R' ? 1 : -1, axes[1] === 'D' ? 1 : -1, axes[2] === 'F' ? 1 : -1];
}

/** Returns the matrix from world to camera with the declared axes: 4x4, row-major, float64. */
export function viewMatrix({ worldToCamera }: Camera, axes: CameraAxes): Float64Array {
  const signs = axisSigns(axes);
  return Float64Array.from({ length: 16 }, (_, i) => worldToCamera[i] * (i < 12 ? signs[Math.floor(i / 4)] : 1));
}

/**
 * Returns the matrix from camera, with the declared axes, to world: the inverse of {@link viewMatrix}; 4x4, row-major,
 * float64.
 */
export const cameraToWorld = (camera: Camera, axes: CameraAxes): Float64Array => inverse(viewMatrix(camera, axes));

/**
 * Returns the intrinsics in pixels or as fractions of the image size: the rows [fx, 0, cx, 0, fy, cy, 0, 0, 1] of a
 * matrix, or [fx, fy, cx, cy].
 */
export function intrinsicsOf(camera: Camera, unit: 'pixels' | 'normalized', isMatrix: boolean): number[] {
  const [across, down] = unit === 'normalized' ? [camera.width, camera.height] : [1, 1];
  const [fx, fy, cx, cy] = [camera.fx / across, camera.fy / down, camera.cx / across, camera.cy / down];
  return isMatrix ? [fx, 0, cx, 0, fy, cy, 0, 0, 1] : [fx, fy, cx, cy];
}

/**
 * Returns the matrix from camera to clip space as in WebGPU: x right, y up, depth 0 at `near` and 1 at `far`, w the
 * distance along the optical axis in world units. 4x4, row-major, float64. The principal point need not be in the
 * center.
 */
export function projectionMatrix(camera: Camera, axes: CameraAxes): Float64Array {
  const { width, height, fx, fy, cx, cy, near, far } = camera;
  const depth = far / (far - near);
  const fromOpenCv = [
    ...[(2 * fx) / width, 0, (2 * cx) / width - 1, 0],
    ...[0, (-2 * fy) / height, 1 - (2 * cy) / height, 0],
    ...[0, 0, depth, -near * depth],
    ...[0, 0, 1, 0],
  ];
  const signs = [...axisSigns(axes), 1];
  return Float64Array.from(fromOpenCv, (value, i) => value * signs[i % 4]);
}

/** Returns the matrix from world to clip space: 4x4, row-major, float64. */
export function viewProjectionMatrix(camera: Camera): Float64Array {
  return multiply(projectionMatrix(camera, 'RDF'), viewMatrix(camera, 'RDF'));
}

/** Returns the 16 numbers of a row-major matrix in the declared order. */
export function inOrder(matrix: ArrayLike<number>, order: MatrixOrder): number[] {
  return Array.from({ length: 16 }, (_, i) => matrix[order === 'row-major' ? i : 4 * (i % 4) + Math.floor(i / 4)]);
}
