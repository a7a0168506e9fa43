import { GaussianSplatError } from './errors.js';
import { cross, dot, eyeOf, normalize, subtract, type Matrix4, type Vector3 } from './vector.js';

/**
 * A pinhole camera in OpenCV's convention: x right, y down, z forward; pixel centres at +0.5.
 * A world point p lands on the pixel (fx·x/z + cx, fy·y/z + cy) with (x, y, z) = worldToCamera · p.
 */
export interface Camera {
  /** Image size in pixels. */
  readonly width: number;
  readonly height: number;
  /** Focal lengths in pixels. */
  readonly fx: number;
  readonly fy: number;
  /** Principal point in pixels. */
  readonly cx: number;
  readonly cy: number;
  /** World to camera, row-major 4x4, last row (0, 0, 0, 1), float64. */
  readonly worldToCamera: Matrix4;
  /** Centres nearer than this, in world units along z, are not drawn. */
  readonly near: number;
  /** Centres farther than this, in world units along z, are not drawn. */
  readonly far: number;
  /**
   * True if all rays are parallel to the camera's axis: a world point lands on (fx·x + cx, fy·y + cy), and focal lengths are pixels for each world
   * unit. Default: false.
   */
  readonly orthographic?: boolean | undefined;
}

/** Near plane of INRIA's rasterizer, which scenes are trained with, in world units. */
export const DEFAULT_NEAR = 0.2;
/** Far plane of gsplat, in world units. */
export const DEFAULT_FAR = 1e10;

/** A camera as calibration files write it, for example one view of a `cameras.json`. */
export interface CalibratedView {
  /** Pixels. */
  readonly width: number;
  readonly height: number;
  /** 3x3 intrinsics [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] in pixels. */
  readonly K: readonly (readonly number[])[];
  /** 4x4 world to camera, rows outermost, OpenCV axes. */
  readonly worldToCamera: readonly (readonly number[])[];
  /** World units; default {@link DEFAULT_NEAR}. */
  readonly near?: number;
  /** World units; default {@link DEFAULT_FAR}. */
  readonly far?: number;
}

/** Reads a calibrated view, checking every field; throws `argument/camera`. `where` names its source in the error. */
export function cameraFromCalibration(view: CalibratedView, where = 'camera'): Camera {
  const { width, height, K, worldToCamera } = view ?? {};
  const isMatrix = (m: unknown, size: number): boolean =>
    Array.isArray(m) && m.length === size && m.every((row) => Array.isArray(row) && row.length === size);
  if (!isMatrix(K, 3)) fail(`${where}.K`, 'a 3x3 array of numbers in pixels', describe(K));
  if (!isMatrix(worldToCamera, 4)) fail(`${where}.worldToCamera`, 'a 4x4 array of numbers', describe(worldToCamera));
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
  };
  validateCamera(camera, where);
  if (K[0][1] !== 0) fail(`${where}.K[0][1]`, '0 (no skew)', describe(K[0][1]));
  // A matrix of columns, or a scaled one, would be taken for one with another middle or other focal lengths.
  for (const [row, column, value] of [
    [2, 0, 0],
    [2, 1, 0],
    [2, 2, 1],
    [1, 0, 0],
  ]) {
    const found = K[row][column];
    if (!(Math.abs(found - value) <= AFFINE_ROUNDING))
      fail(`${where}.K[${row}][${column}]`, `${value}`, describe(found));
  }
  return camera;
}

/** How a host's projection writes depth. */
export interface ProjectionOptions {
  /** Image size in pixels. */
  readonly width: number;
  readonly height: number;
  /** Range of depth behind the division by w: `0..1` as WebGPU has it, or `-1..1` as OpenGL does. Default: `0..1`. */
  readonly clipDepth?: '0..1' | '-1..1';
}

/** Of the distance between the planes: where the near plane of parallel rays is put that lies at the eye or behind it. */
const LEAST_NEAR = 1e-3;

/**
 * A camera from the two matrices of a host such as three.js, glMatrix or WebXR: x right, y up, z backward, clip space as GPUs have it.
 *
 * ```ts
 * const camera = cameraFromProjection(camera3.matrixWorldInverse.elements, camera3.projectionMatrix.elements, { width, height });
 * ```
 * @param view world to camera, 16 numbers, column-major
 * @param projection perspective or orthographic, 16 numbers, column-major; off-centre and reversed ones, and those without a far plane, too
 * @throws GaussianSplatError `argument/camera` for a projection with skew, or one that is neither.
 */
export function cameraFromProjection(
  view: ArrayLike<number>,
  projection: ArrayLike<number>,
  { width, height, clipDepth = '0..1' }: ProjectionOptions,
): Camera {
  const p = projection;
  const isMatrix = (m: ArrayLike<number>): boolean =>
    m?.length === 16 && Array.prototype.every.call(m, Number.isFinite);
  if (!isMatrix(view)) fail('view', '16 finite numbers, column-major', describe(view));
  if (!isMatrix(p)) fail('projection', '16 finite numbers, column-major', describe(p));
  const orthographic = p[11] === 0 && p[15] === 1;
  if (!orthographic && !(p[11] === -1 && p[15] === 0))
    fail('projection', 'a last row of 0, 0, -1, 0 or 0, 0, 0, 1', describe([p[3], p[7], p[11], p[15]]));
  const skew = Math.max(...[1, 2, 3, 4, 6, 7].map((k) => Math.abs(p[k])));
  if (skew !== 0) fail('projection', 'no skew: 0 beside the diagonal and the centre', describe(Array.from(p)));
  const [x, y] = orthographic ? [p[12], -p[13]] : [-p[8], p[9]];
  const planes = (clipDepth === '0..1' ? [0, 1] : [-1, 1]).map((depth) =>
    orthographic ? (p[14] - depth) / p[10] : p[14] / (p[10] + depth),
  );
  // A projection without a far plane divides by nothing, or next to it.
  const distances = planes.map((plane) => (Number.isFinite(plane) && (orthographic || plane > 0) ? plane : Infinity));
  const [nearest, far] = [Math.min(...distances), Math.max(...distances)];
  const back = orthographic && nearest <= 0 ? LEAST_NEAR * (far - nearest) - nearest : 0;
  const flip = [1, -1, -1, 1];
  const worldToCamera = Float64Array.from(
    { length: 16 },
    (_, k) => flip[Math.floor(k / 4)] * view[4 * (k % 4) + Math.floor(k / 4)],
  );
  worldToCamera[11] += back;
  const camera: Camera = {
    ...{ width, height, worldToCamera },
    fx: (p[0] * width) / 2,
    fy: (p[5] * height) / 2,
    cx: (width * (1 + x)) / 2,
    cy: (height * (1 + y)) / 2,
    near: nearest + back,
    far: far + back,
    ...(orthographic && { orthographic }),
  };
  validateCamera(camera);
  return camera;
}

/**
 * A camera from the one matrix that maps give: from the coordinates of a scene to clip space, perspective.
 * @param matrix 16 numbers, column-major; it may scale
 * @throws GaussianSplatError `argument/camera` for a matrix with skew, a mirrored one, and one that is no perspective.
 */
export function cameraFromClip(
  matrix: ArrayLike<number>,
  { width, height, clipDepth = '0..1' }: ProjectionOptions,
): Camera {
  if (matrix?.length !== 16 || !Array.prototype.every.call(matrix, Number.isFinite))
    fail('matrix', '16 finite numbers, column-major', describe(matrix));
  const [x, y, z, w] = [0, 1, 2, 3].map((row): Vector3 => [matrix[row], matrix[4 + row], matrix[8 + row]]);
  const squared = dot(w, w);
  if (squared === 0) fail('matrix', 'a perspective', describe(Array.from(matrix)));
  // Rows of clip space are those of the camera: each is a multiple of one, and of the depth's.
  const axis = (row: Vector3, number: number): { focal: number; shift: number; row: number[] } => {
    const shift = dot(row, w) / squared;
    const own = [0, 1, 2].map((k) => row[k] - shift * w[k]) as unknown as Vector3;
    const focal = Math.sqrt(dot(own, own) / squared);
    return { focal, shift, row: [...own, matrix[12 + number] - shift * matrix[15]].map((value) => value / focal) };
  };
  const [right, up] = [axis(x, 0), axis(y, 1)];
  const down = up.row.map((value) => -value);
  const [r, d] = [right.row, down].map(([a, b, c]): Vector3 => [a, b, c]);
  if (Math.abs(dot(r, d)) > SKEW * squared) fail('matrix', 'no skew', describe(Array.from(matrix)));
  if (!(dot(cross(r, d), w) > 0)) fail('matrix', 'one that mirrors nothing', describe(Array.from(matrix)));
  const depth = dot(z, w) / squared;
  const offset = matrix[14] - depth * matrix[15];
  const planes = (clipDepth === '0..1' ? [0, 1] : [-1, 1])
    .map((plane) => offset / (plane - depth))
    .map((plane) => (Number.isFinite(plane) && plane > 0 ? plane : Infinity));
  const camera: Camera = {
    ...{ width, height },
    worldToCamera: Float64Array.from([...right.row, ...down, ...w, matrix[15], 0, 0, 0, 1]),
    fx: (right.focal * width) / 2,
    fy: (up.focal * height) / 2,
    cx: (width * (1 + right.shift)) / 2,
    cy: (height * (1 - up.shift)) / 2,
    near: Math.min(...planes),
    far: Math.max(...planes),
  };
  validateCamera(camera);
  return camera;
}

/** Cosine of the angle between the axes of a picture up to which that is none: matrices of maps are rounded. */
const SKEW = 1e-3;

/** How far the last row of a matrix may be from 0, 0, 0, 1. */
const AFFINE_ROUNDING = 1e-6;

/** Throws `argument/camera` if a field of the camera is out of its documented range. */
export function validateCamera(camera: Camera, where = 'camera'): void {
  const { width, height, fx, fy, cx, cy, worldToCamera, near, far } = camera;
  for (const [name, value] of Object.entries({ width, height })) {
    if (!Number.isInteger(value) || value < 1)
      fail(`${where}.${name}`, 'a whole number of pixels, 1 or more', describe(value));
  }
  for (const [name, value] of Object.entries({ fx, fy })) {
    if (!(Number.isFinite(value) && value > 0))
      fail(`${where}.${name}`, 'a focal length in pixels above 0', describe(value));
  }
  for (const [name, value] of Object.entries({ cx, cy })) {
    if (!Number.isFinite(value)) fail(`${where}.${name}`, 'a finite number of pixels', describe(value));
  }
  if (!(near > 0 && near < far)) fail(`${where}.near`, 'a distance above 0 and below far', `near ${near}, far ${far}`);
  if (worldToCamera?.length !== 16 || !Array.prototype.every.call(worldToCamera, Number.isFinite)) {
    fail(`${where}.worldToCamera`, '16 finite numbers, row-major', describe(worldToCamera));
  }
  const [x, y, z, w] = [12, 13, 14, 15].map((k) => worldToCamera[k]);
  if (Math.max(Math.abs(x), Math.abs(y), Math.abs(z), Math.abs(w - 1)) > AFFINE_ROUNDING) {
    fail(`${where}.worldToCamera`, 'a last row of 0, 0, 0, 1: row-major, not column-major', describe([x, y, z, w]));
  }
  // A camera that makes space flat is nowhere.
  if (!eyeOf(worldToCamera).every(Number.isFinite))
    fail(`${where}.worldToCamera`, 'a matrix that can be inverted', describe([...worldToCamera]));
}

/**
 * World-to-camera matrix (row-major, OpenCV axes) of an eye that looks at a target.
 * @param up direction that points up in the image; must not be parallel to the line of sight.
 */
export function lookAt(eye: Vector3, target: Vector3, up: Vector3): Float64Array {
  const forward = normalize(subtract(target, eye));
  const right = normalize(cross(forward, up));
  const down = cross(forward, right);
  const row = (axis: Vector3): number[] => [...axis, -dot(axis, eye)];
  return Float64Array.from([...row(right), ...row(down), ...row(forward), 0, 0, 0, 1]);
}

function describe(value: unknown): string {
  const text = JSON.stringify(value);
  return text === undefined ? 'nothing' : text.length > 80 ? `${text.slice(0, 77)}...` : text;
}

function fail(where: string, expected: string, found: string): never {
  throw new GaussianSplatError('argument/camera', {
    where,
    expected,
    found,
    remedy: 'give {width, height, K, worldToCamera} in pixels and OpenCV axes (x right, y down, z forward)',
  });
}
