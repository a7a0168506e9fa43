/** Eigenvalues and eigenvectors of symmetric 3x3 matrices, by Jacobi's rotations in float64. */

export interface Eigenvectors {
  readonly values: readonly [number, number, number];
  /** Row-major; column k belongs to value k; a rotation (determinant 1). */
  readonly vectors: readonly (readonly number[])[];
}

/** @param matrix xx, xy, xz, yy, yz, zz */
export function eigenvectors([xx, xy, xz, yy, yz, zz]: ArrayLike<number> & Iterable<number>): Eigenvectors {
  const a = [
    [xx, xy, xz],
    [xy, yy, yz],
    [xz, yz, zz],
  ];
  const v = [
    [1, 0, 0],
    [0, 1, 0],
    [0, 0, 1],
  ];
  for (let sweep = 0; sweep < 30; sweep++) {
    for (const [p, q] of [
      [0, 1],
      [0, 2],
      [1, 2],
    ]) {
      if (a[p][q] !== 0) rotate(a, v, p, q);
    }
  }
  const determinant =
    v[0][0] * (v[1][1] * v[2][2] - v[1][2] * v[2][1]) -
    v[0][1] * (v[1][0] * v[2][2] - v[1][2] * v[2][0]) +
    v[0][2] * (v[1][0] * v[2][1] - v[1][1] * v[2][0]);
  if (determinant < 0) for (const row of v) row[0] = -row[0];
  return { values: [a[0][0], a[1][1], a[2][2]], vectors: v };
}

function rotate(a: number[][], v: number[][], p: number, q: number): void {
  const theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
  const t = (theta < 0 ? -1 : 1) / (Math.abs(theta) + Math.sqrt(theta * theta + 1));
  const c = 1 / Math.sqrt(t * t + 1);
  const s = t * c;
  for (let k = 0; k < 3; k++) [a[k][p], a[k][q]] = [c * a[k][p] - s * a[k][q], s * a[k][p] + c * a[k][q]];
  for (let k = 0; k < 3; k++) [a[p][k], a[q][k]] = [c * a[p][k] - s * a[q][k], s * a[p][k] + c * a[q][k]];
  for (let k = 0; k < 3; k++) [v[k][p], v[k][q]] = [c * v[k][p] - s * v[k][q], s * v[k][p] + c * v[k][q]];
}

/** (w, x, y, z) of a rotation matrix: from the largest of the four, which never divides by little. */
export function quaternionOf(m: readonly (readonly number[])[]): [number, number, number, number] {
  const trace = m[0][0] + m[1][1] + m[2][2];
  const squares = [trace, m[0][0], m[1][1], m[2][2]];
  const largest = squares.indexOf(Math.max(...squares));
  const d = [m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]];
  const s = [m[0][1] + m[1][0], m[0][2] + m[2][0], m[1][2] + m[2][1]];
  const q = [
    [1 + trace, d[0], d[1], d[2]],
    [d[0], 1 + m[0][0] - m[1][1] - m[2][2], s[0], s[1]],
    [d[1], s[0], 1 - m[0][0] + m[1][1] - m[2][2], s[2]],
    [d[2], s[1], s[2], 1 - m[0][0] - m[1][1] + m[2][2]],
  ][largest];
  const norm = Math.hypot(...q);
  return [q[0] / norm, q[1] / norm, q[2] / norm, q[3] / norm];
}
