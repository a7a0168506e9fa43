/** From a Gaussian in the world to an ellipse on the screen: EWA splatting (Zwicker et al. 2001) as 3DGS uses it. */
import type { Camera, GaussianCloud, Vector3 } from '@gaussian-splat/core';
import type { Rules } from './rules.js';

/** A symmetric 2x2 matrix [[xx, xy], [xy, yy]]. */
export interface Symmetric2 {
  readonly xx: number;
  readonly xy: number;
  readonly yy: number;
}

/** A Gaussian on the screen. */
export interface Ellipse {
  /** Center in pixels; pixel (column, row) has its own center at (column + 0.5, row + 0.5). */
  readonly x: number;
  readonly y: number;
  /** Dilated screen covariance, px². */
  readonly covariance: Symmetric2;
  /** Its inverse, px⁻². */
  readonly conic: Symmetric2;
  /** sqrt(det Σ / det(Σ + dilation·I)): the fraction of its peak that the Gaussian would lose by true convolution. */
  readonly compensation: number;
}

/** Position of splat `i` in the world, float64. */
export function worldPosition(cloud: GaussianCloud, i: number): Vector3 {
  const { positions, origin } = cloud;
  return [positions[3 * i] + origin[0], positions[3 * i + 1] + origin[1], positions[3 * i + 2] + origin[2]];
}

/** A world point in camera axes (x right, y down, z forward). */
export function toCamera(camera: Camera, [x, y, z]: Vector3): Vector3 {
  const m = camera.worldToCamera;
  return [
    m[0] * x + m[1] * y + m[2] * z + m[3],
    m[4] * x + m[5] * y + m[6] * z + m[7],
    m[8] * x + m[9] * y + m[10] * z + m[11],
  ];
}

/** The screen ellipse of splat `i` whose center lies at `center` in camera axes, z > 0. */
export function projectEllipse(
  cloud: GaussianCloud,
  i: number,
  camera: Camera,
  center: Vector3,
  rules: Rules,
): Ellipse {
  const [x, y, z] = center;
  const factor = multiply(jacobian(camera, center, rules), multiply(linearPart(camera), rotationTimesScale(cloud, i)));
  const [rowX, rowY] = factor;
  const exact = { xx: dot(rowX, rowX), xy: dot(rowX, rowY), yy: dot(rowY, rowY) };
  const exactDeterminant = gramDeterminant(rowX, rowY);

  const covariance = { xx: exact.xx + rules.dilation, xy: exact.xy, yy: exact.yy + rules.dilation };
  // det(Σ + d·I) = det Σ + d·trace Σ + d²: only sums of non-negative numbers, so thin ellipses keep their digits.
  const determinant = exactDeterminant + rules.dilation * (exact.xx + exact.yy) + rules.dilation ** 2;
  const shrink = camera.orthographic ? 1 : z;
  return {
    x: (camera.fx * x) / shrink + camera.cx,
    y: (camera.fy * y) / shrink + camera.cy,
    covariance,
    conic: { xx: covariance.yy / determinant, xy: -covariance.xy / determinant, yy: covariance.xx / determinant },
    compensation: Math.sqrt(Math.max(rules.compensationFloor, exactDeterminant / determinant)),
  };
}

/**
 * Derivative of the pixel position by the camera-space point: [[fx/z, 0, -fx·x/z²], [0, fy/z, -fy·y/z²]]. Centers far
 * outside the view are moved to just beyond its edge first, because the linear approximation explodes out there.
 */
export function jacobian(camera: Camera, [x, y, z]: Vector3, rules: Rules): [number[], number[]] {
  if (camera.orthographic) {
    return [
      [camera.fx, 0, 0],
      [0, camera.fy, 0],
    ];
  }
  const { width, height, fx, fy, cx, cy } = camera;
  const marginX = (rules.jacobianMargin * width) / (2 * fx);
  const marginY = (rules.jacobianMargin * height) / (2 * fy);
  const slopeX = clamp(x / z, -cx / fx - marginX, (width - cx) / fx + marginX);
  const slopeY = clamp(y / z, -cy / fy - marginY, (height - cy) / fy + marginY);
  return [
    [fx / z, 0, (-fx * slopeX) / z],
    [0, fy / z, (-fy * slopeY) / z],
  ];
}

/** A cloud whose covariances may be those of matrices in place of rotations and scales. */
export interface ShearedCloud extends GaussianCloud {
  /** 3x3 for each splat, as {@link rotationTimesScale} returns it. */
  readonly axes?: readonly number[][][];
}

/** R·S, so that the covariance is (R·S)(R·S)ᵀ: the rotation of the quaternion (w, x, y, z), columns scaled. */
export function rotationTimesScale(cloud: ShearedCloud, i: number): number[][] {
  if (cloud.axes) return cloud.axes[i];
  const q = cloud.rotations.subarray(4 * i, 4 * i + 4);
  const norm = Math.hypot(q[0], q[1], q[2], q[3]);
  const [w, x, y, z] = [q[0] / norm, q[1] / norm, q[2] / norm, q[3] / norm];
  const [sx, sy, sz] = cloud.scales.subarray(3 * i, 3 * i + 3);
  return [
    [(1 - 2 * (y * y + z * z)) * sx, 2 * (x * y - w * z) * sy, 2 * (x * z + w * y) * sz],
    [2 * (x * y + w * z) * sx, (1 - 2 * (x * x + z * z)) * sy, 2 * (y * z - w * x) * sz],
    [2 * (x * z - w * y) * sx, 2 * (y * z + w * x) * sy, (1 - 2 * (x * x + y * y)) * sz],
  ];
}

export function linearPart({ worldToCamera: m }: Camera): number[][] {
  return [
    [m[0], m[1], m[2]],
    [m[4], m[5], m[6]],
    [m[8], m[9], m[10]],
  ];
}

/** Determinant of the matrix of dot products of two vectors: the sum of their squared 2x2 minors (Cauchy-Binet). */
function gramDeterminant(a: number[], b: number[]): number {
  return (a[1] * b[2] - a[2] * b[1]) ** 2 + (a[2] * b[0] - a[0] * b[2]) ** 2 + (a[0] * b[1] - a[1] * b[0]) ** 2;
}

/** The product of matrices of three columns and of three rows. */
function multiply(a: number[][], b: number[][]): number[][] {
  return a.map((row) =>
    [0, 1, 2].map((column) => row[0] * b[0][column] + row[1] * b[1][column] + row[2] * b[2][column]),
  );
}

const dot = (a: number[], b: number[]): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

const clamp = (value: number, low: number, high: number): number => Math.min(high, Math.max(low, value));
