/** Minimal float64 linear algebra for cameras and bounds. Matrices are row-major, and act on column vectors. */

export type Vector3 = readonly [x: number, y: number, z: number];

/** Row-major 4x4 matrix: element (row, column) at 4·row + column. Acts on column vectors. */
export type Matrix4 = readonly number[] | Float64Array;

export const add = (a: Vector3, b: Vector3): Vector3 => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const subtract = (a: Vector3, b: Vector3): Vector3 => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const scale = (a: Vector3, s: number): Vector3 => [a[0] * s, a[1] * s, a[2] * s];
export const dot = (a: Vector3, b: Vector3): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a: Vector3, b: Vector3): Vector3 => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];
export const length = (a: Vector3): number => Math.hypot(a[0], a[1], a[2]);
export const normalize = (a: Vector3): Vector3 => scale(a, 1 / length(a));

/** Returns the product a·b of two row-major 4x4 matrices. */
export function multiply(a: Matrix4, b: Matrix4): Float64Array {
  const out = new Float64Array(16);
  for (let row = 0; row < 4; row++) {
    for (let column = 0; column < 4; column++) {
      let sum = 0;
      for (let k = 0; k < 4; k++) sum += a[4 * row + k] * b[4 * k + column];
      out[4 * row + column] = sum;
    }
  }
  return out;
}

/**
 * Returns the position of the eye in world units: the point that an affine world-to-camera matrix maps to the origin.
 */
export function eyeOf(worldToCamera: Matrix4): Vector3 {
  const m = inverse(worldToCamera);
  return [m[3], m[7], m[11]];
}

/** Returns the inverse of an affine matrix; its entries are not finite for a singular matrix. */
export function inverse(m: Matrix4): Float64Array {
  const rows: [Vector3, Vector3, Vector3] = [
    [m[0], m[1], m[2]],
    [m[4], m[5], m[6]],
    [m[8], m[9], m[10]],
  ];
  // Cramer's rule also inverts sheared and scaled matrices.
  const determinant = dot(rows[0], cross(rows[1], rows[2]));
  const column = (a: Vector3, b: Vector3): Vector3 => scale(cross(a, b), 1 / determinant);
  const [c0, c1, c2] = [column(rows[1], rows[2]), column(rows[2], rows[0]), column(rows[0], rows[1])];
  const moved = add(add(scale(c0, -m[3]), scale(c1, -m[7])), scale(c2, -m[11]));
  return Float64Array.from([0, 1, 2].flatMap((i) => [c0[i], c1[i], c2[i], moved[i]]).concat(0, 0, 0, 1));
}
