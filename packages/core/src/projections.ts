/** Converts the matrices of other renderers into cameras. A separate module, because few pages need it. */
import { describeCamera as describe, failCamera as fail, validateCamera, type Camera } from './camera.js';
import { cross, dot, type Vector3 } from './vector.js';

/** Image size and depth range of a projection. */
export interface ProjectionOptions {
  /** Width of the image in pixels. */
  readonly width: number;
  /** Height of the image in pixels. */
  readonly height: number;
  /** Range of depth after the division by w: `0..1` as in WebGPU, or `-1..1` as in OpenGL. Default: `0..1`. */
  readonly clipDepth?: '0..1' | '-1..1';
}

/**
 * Near plane of an orthographic camera that is moved back, as a fraction of the distance between the planes. The camera
 * is moved if its near plane is at the eye or behind it, because `Camera.near` must be positive.
 */
const MIN_NEAR = 1e-3;

/**
 * Returns a camera for the two matrices of a host such as three.js, glMatrix or WebXR: x right, y up, z backward, clip
 * space of GPUs.
 *
 * ```ts
 * const camera = cameraFromProjection(camera3.matrixWorldInverse.elements, camera3.projectionMatrix.elements, { width,
 * height });
 * ```
 * @param view Matrix from world to camera coordinates: 16 numbers, column-major.
 * @param projection Perspective or orthographic projection: 16 numbers, column-major. It may be off-center or have
 * reversed depth, and need not have a far plane.
 * @throws GaussianSplatError `argument/camera` for a projection with skew, or one that is neither perspective nor
 * orthographic.
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
  if (skew !== 0) fail('projection', 'no skew: 0 beside the diagonal and the center', describe(Array.from(p)));
  const [x, y] = orthographic ? [p[12], -p[13]] : [-p[8], p[9]];
  const planes = (clipDepth === '0..1' ? [0, 1] : [-1, 1]).map((depth) =>
    orthographic ? (p[14] - depth) / p[10] : p[14] / (p[10] + depth),
  );
  // The distance of an infinite far plane results from a division by zero, or by nearly zero.
  const distances = planes.map((plane) => (Number.isFinite(plane) && (orthographic || plane > 0) ? plane : Infinity));
  const [nearest, far] = [Math.min(...distances), Math.max(...distances)];
  const back = orthographic && nearest <= 0 ? MIN_NEAR * (far - nearest) - nearest : 0;
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
 * Returns a camera for the perspective matrix from scene coordinates to clip space that map libraries provide.
 * @param matrix 16 numbers, column-major. The matrix may scale.
 * @throws GaussianSplatError `argument/camera` for a matrix that has skew, mirrors, or has no perspective.
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
  // Each row of clip space is a combination of a camera row and the depth row.
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
  if (!(dot(cross(r, d), w) > 0)) fail('matrix', 'one without mirroring', describe(Array.from(matrix)));
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

/** Maximum cosine of the angle between the image axes. It is not 0, because map libraries round their matrices. */
const SKEW = 1e-3;
