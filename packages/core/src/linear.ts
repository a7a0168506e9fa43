/** 3 x 3 matrices, row-major, in float64. */
export type Matrix3 = readonly number[];

export function determinant(m: Matrix3): number {
  return m[0] * (m[4] * m[8] - m[5] * m[7]) - m[1] * (m[3] * m[8] - m[5] * m[6]) + m[2] * (m[3] * m[7] - m[4] * m[6]);
}

export function multiply3(a: Matrix3, b: Matrix3): number[] {
  return [0, 1, 2].flatMap((row) =>
    [0, 1, 2].map((k) => a[3 * row] * b[k] + a[3 * row + 1] * b[3 + k] + a[3 * row + 2] * b[6 + k]),
  );
}

export function transposed(m: Matrix3): number[] {
  return [m[0], m[3], m[6], m[1], m[4], m[7], m[2], m[5], m[8]];
}

function inverseTransposed(m: Matrix3): number[] {
  const d = determinant(m);
  return [
    ...[m[4] * m[8] - m[5] * m[7], m[5] * m[6] - m[3] * m[8], m[3] * m[7] - m[4] * m[6]],
    ...[m[2] * m[7] - m[1] * m[8], m[0] * m[8] - m[2] * m[6], m[1] * m[6] - m[0] * m[7]],
    ...[m[1] * m[5] - m[2] * m[4], m[2] * m[3] - m[0] * m[5], m[0] * m[4] - m[1] * m[3]],
  ].map((cofactor) => cofactor / d);
}

/**
 * Returns the rotation or reflection nearest to an invertible matrix: its orthogonal polar factor (Newton's iteration).
 */
export function orthogonalFactor(m: Matrix3): number[] {
  const size = Math.cbrt(Math.abs(determinant(m)));
  let q = m.map((value) => value / size);
  for (let step = 0; step < 60; step++) {
    const inverse = inverseTransposed(q);
    const next = q.map((value, k) => (value + inverse[k]) / 2);
    const change = Math.max(...next.map((value, k) => Math.abs(value - q[k])));
    q = next;
    if (change < 1e-15) break;
  }
  return q;
}

/** Returns the rotation matrix of a unit quaternion (w, x, y, z). */
export function matrixOfQuaternion(w: number, x: number, y: number, z: number): number[] {
  return [
    ...[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
    ...[2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
    ...[2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
  ];
}

/** Returns the unit quaternion (w, x, y, z) of a rotation matrix. Its largest component is positive. */
export function quaternionOfMatrix(m: Matrix3): [number, number, number, number] {
  const trace = m[0] + m[4] + m[8];
  // The largest component is computed from its square. The others follow from it without loss of precision.
  const squares = [1 + trace, 1 + 2 * m[0] - trace, 1 + 2 * m[4] - trace, 1 + 2 * m[8] - trace];
  const largest = squares.indexOf(Math.max(...squares));
  const [yz, zx, xy] = [m[7] - m[5], m[2] - m[6], m[3] - m[1]];
  const [sxy, sxz, syz] = [m[1] + m[3], m[2] + m[6], m[5] + m[7]];
  const q = [
    [squares[0], yz, zx, xy],
    [yz, squares[1], sxy, sxz],
    [zx, sxy, squares[2], syz],
    [xy, sxz, syz, squares[3]],
  ][largest];
  const norm = Math.hypot(...q);
  return [q[0] / norm, q[1] / norm, q[2] / norm, q[3] / norm];
}

const AXIS_PAIRS = [
  [0, 1],
  [0, 2],
  [1, 2],
] as const;

/**
 * Returns the eigenvalues of a symmetric matrix, unsorted, and its eigenvectors as the columns of a rotation (Jacobi's
 * method).
 */
export function symmetricEigen(m: Matrix3): { values: [number, number, number]; vectors: number[] } {
  const a = [...m];
  const vectors = [1, 0, 0, 0, 1, 0, 0, 0, 1];
  for (let sweep = 0; sweep < 24; sweep++) {
    const off = a[1] * a[1] + a[2] * a[2] + a[5] * a[5];
    if (off <= 1e-30 * (a[0] * a[0] + a[4] * a[4] + a[8] * a[8])) break;
    for (const [p, q] of AXIS_PAIRS) {
      const apq = a[3 * p + q];
      if (apq === 0) continue;
      const theta = (a[4 * q] - a[4 * p]) / (2 * apq);
      const t = (theta < 0 ? -1 : 1) / (Math.abs(theta) + Math.sqrt(theta * theta + 1));
      const c = 1 / Math.sqrt(t * t + 1);
      const s = t * c;
      for (let k = 0; k < 3; k++) turn(a, 3 * p + k, 3 * q + k, c, s);
      for (let k = 0; k < 3; k++) turn(a, 3 * k + p, 3 * k + q, c, s);
      for (let k = 0; k < 3; k++) turn(vectors, 3 * k + p, 3 * k + q, c, s);
    }
  }
  return { values: [a[0], a[4], a[8]], vectors };
}

/** Rotates the pair of entries `p` and `q`, in place, by the angle with cosine `c` and sine `s`. */
function turn(entries: number[], p: number, q: number, c: number, s: number): void {
  const [first, second] = [entries[p], entries[q]];
  entries[p] = c * first - s * second;
  entries[q] = s * first + c * second;
}
