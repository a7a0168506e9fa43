import { GaussianSplatError } from './errors.js';
import { cross, dot, eyeOf, normalize, subtract, type Matrix4, type Vector3 } from './vector.js';

/**
 * A pinhole camera in OpenCV's convention: x right, y down, z forward; pixel centers at +0.5. A world point p projects
 * to the pixel (fx·x/z + cx, fy·y/z + cy) with (x, y, z) = worldToCamera · p.
 */
export interface Camera {
  /** Width of the image in pixels. */
  readonly width: number;
  /** Height of the image in pixels. */
  readonly height: number;
  /** Horizontal focal length in pixels. */
  readonly fx: number;
  /** Vertical focal length in pixels. */
  readonly fy: number;
  /** Distance of the principal point from the left edge of the image in pixels. */
  readonly cx: number;
  /** Distance of the principal point from the top edge of the image in pixels. */
  readonly cy: number;
  /** Matrix from world to camera coordinates: row-major 4x4, last row (0, 0, 0, 1), float64. */
  readonly worldToCamera: Matrix4;
  /** Minimum z, in world units, of the centers of drawn splats. */
  readonly near: number;
  /** Maximum z, in world units, of the centers of drawn splats. */
  readonly far: number;
  /**
   * Whether all rays are parallel to the optical axis. A world point then projects to (fx·x + cx, fy·y + cy), and focal
   * lengths are in pixels per world unit. Default: false.
   */
  readonly orthographic?: boolean | undefined;
}

/** Near plane of INRIA's rasterizer, which is used in training, in world units. */
const DEFAULT_NEAR = 0.2;
/** Far plane of gsplat, in world units. */
export const DEFAULT_FAR = 1e10;

/** A camera in the layout of calibration files, for example one view of a `cameras.json`. */
export interface CalibratedView {
  /** Width of the image in pixels. */
  readonly width: number;
  /** Height of the image in pixels. */
  readonly height: number;
  /** 3x3 intrinsics [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] in pixels. */
  readonly K: readonly (readonly number[])[];
  /** 4x4 matrix from world to camera coordinates, row-major, OpenCV axes. */
  readonly worldToCamera: readonly (readonly number[])[];
  /** Near plane in world units; default 0.2. */
  readonly near?: number;
  /** Far plane in world units; default {@link DEFAULT_FAR}. */
  readonly far?: number;
  /** Whether all rays are parallel: see {@link Camera.orthographic}. */
  readonly orthographic?: boolean;
}

/**
 * Returns the camera of a calibrated view. Throws `argument/camera` if a field is invalid; `where` is the name of the
 * view in the error.
 */
export function cameraFromCalibration(view: CalibratedView, where = 'camera'): Camera {
  const { width, height, K, worldToCamera, orthographic } = view ?? {};
  const isMatrix = (m: unknown, size: number): boolean =>
    Array.isArray(m) && m.length === size && m.every((row) => Array.isArray(row) && row.length === size);
  if (!isMatrix(K, 3)) failCamera(`${where}.K`, 'a 3x3 array of numbers in pixels', describeCamera(K));
  if (!isMatrix(worldToCamera, 4))
    failCamera(`${where}.worldToCamera`, 'a 4x4 array of numbers', describeCamera(worldToCamera));
  const camera: Camera = {
    width,
    height,
    fx: K[0][0],
    fy: K[1][1],
    cx: K[0][2],
    cy: K[1][2],
    worldToCamera: worldToCamera.flat(),
    near: view.near ?? DEFAULT_NEAR,
    far: view.far ?? DEFAULT_FAR,
    ...(orthographic !== undefined && { orthographic }),
  };
  validateCamera(camera, where);
  if (K[0][1] !== 0) failCamera(`${where}.K[0][1]`, '0 (no skew)', describeCamera(K[0][1]));
  // The last row is checked, because a column-major or scaled matrix would give another principal point or focal
  // length.
  for (const [row, column, value] of [
    [2, 0, 0],
    [2, 1, 0],
    [2, 2, 1],
    [1, 0, 0],
  ]) {
    const found = K[row][column];
    if (!(Math.abs(found - value) <= AFFINE_ROUNDING))
      failCamera(`${where}.K[${row}][${column}]`, `${value}`, describeCamera(found));
  }
  return camera;
}

/** Tolerance of the entries of a matrix that must be 0 or 1. */
const AFFINE_ROUNDING = 1e-6;

/** Throws `argument/camera` if a field of the camera is out of its documented range. */
export function validateCamera(camera: Camera, where = 'camera'): void {
  const { width, height, fx, fy, cx, cy, worldToCamera, near, far } = camera;
  for (const [name, value] of Object.entries({ width, height })) {
    if (!Number.isInteger(value) || value < 1)
      failCamera(`${where}.${name}`, 'a whole number of pixels, 1 or more', describeCamera(value));
  }
  for (const [name, value] of Object.entries({ fx, fy })) {
    if (!(Number.isFinite(value) && value > 0))
      failCamera(`${where}.${name}`, 'a focal length in pixels above 0', describeCamera(value));
  }
  for (const [name, value] of Object.entries({ cx, cy })) {
    if (!Number.isFinite(value)) failCamera(`${where}.${name}`, 'a finite number of pixels', describeCamera(value));
  }
  if (!(near > 0 && near < far))
    failCamera(`${where}.near`, 'a distance above 0 and below far', `near ${near}, far ${far}`);
  if (worldToCamera?.length !== 16 || !Array.prototype.every.call(worldToCamera, Number.isFinite)) {
    failCamera(`${where}.worldToCamera`, '16 finite numbers, row-major', describeCamera(worldToCamera));
  }
  const [x, y, z, w] = [12, 13, 14, 15].map((k) => worldToCamera[k]);
  if (Math.max(Math.abs(x), Math.abs(y), Math.abs(z), Math.abs(w - 1)) > AFFINE_ROUNDING) {
    failCamera(
      `${where}.worldToCamera`,
      'a last row of 0, 0, 0, 1: row-major, not column-major',
      describeCamera([x, y, z, w]),
    );
  }
  // The matrix of a camera must be invertible.
  if (!eyeOf(worldToCamera).every(Number.isFinite))
    failCamera(`${where}.worldToCamera`, 'a matrix that can be inverted', describeCamera([...worldToCamera]));
}

/**
 * Returns the world-to-camera matrix (row-major, OpenCV axes) of an eye that looks at a target.
 * @param up Direction that points up in the image; must not be parallel to the line of sight.
 */
export function lookAt(eye: Vector3, target: Vector3, up: Vector3): Float64Array {
  const forward = normalize(subtract(target, eye));
  const right = normalize(cross(forward, up));
  const down = cross(forward, right);
  const row = (axis: Vector3): number[] => [...axis, -dot(axis, eye)];
  return Float64Array.from([...row(right), ...row(down), ...row(forward), 0, 0, 0, 1]);
}

/** Describes a value in an error, in up to 80 characters of JSON. @internal */
export function describeCamera(value: unknown): string {
  const text = JSON.stringify(value);
  return text === undefined ? 'nothing' : text.length > 80 ? `${text.slice(0, 77)}...` : text;
}

/** @internal */
export function failCamera(where: string, expected: string, found: string): never {
  throw new GaussianSplatError('argument/camera', {
    where,
    expected,
    found,
    remedy: 'give {width, height, K, worldToCamera} in pixels and OpenCV axes (x right, y down, z forward)',
  });
}
