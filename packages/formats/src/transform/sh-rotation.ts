import type { Matrix3 } from '@gaussian-splat/core';

/**
 * Real spherical harmonics of bands 1 to 3 at a unit direction, without their common factor, in the order and with the
 * signs of 3D Gaussian Splatting.
 */
const BANDS: readonly ((x: number, y: number, z: number) => number[])[] = [
  (x, y, z) => [-y, z, -x],
  (x, y, z) => {
    const [a, b] = [Math.sqrt(15), Math.sqrt(5) / 2];
    return [a * x * y, -a * y * z, b * (2 * z * z - x * x - y * y), -a * x * z, (a / 2) * (x * x - y * y)];
  },
  (x, y, z) => {
    const [a, b, c, d] = [Math.sqrt(35 / 8), Math.sqrt(105), Math.sqrt(21 / 8), Math.sqrt(7) / 2];
    const ring = 4 * z * z - x * x - y * y;
    return [
      -a * y * (3 * x * x - y * y),
      b * x * y * z,
      -c * y * ring,
      d * z * (2 * z * z - 3 * x * x - 3 * y * y),
      -c * x * ring,
      (b / 2) * z * (x * x - y * y),
      -a * x * (x * x - 3 * y * y),
    ];
  },
];

/**
 * Unit directions on a spiral over the sphere for fitting rotated harmonics. There are more directions than
 * coefficients in a band.
 */
const DIRECTIONS = Array.from({ length: 24 }, (_, k) => {
  const z = 1 - (2 * k + 1) / 24;
  const angle = k * Math.PI * (3 - Math.sqrt(5));
  const radius = Math.sqrt(1 - z * z);
  return [radius * Math.cos(angle), radius * Math.sin(angle), z];
});

/**
 * Returns the matrix, row-major [2·band + 1, 2·band + 1], that rotates the coefficients of a band by an orthogonal
 * matrix, which may be a reflection. The rotated function in direction d equals the original function in the direction
 * that `turn` rotates to d.
 *
 * @param band 1, 2 or 3.
 */
export function shRotation(band: 1 | 2 | 3, turn: Matrix3): Float64Array {
  const basis = BANDS[band - 1];
  const size = 2 * band + 1;
  const after = DIRECTIONS.map(([x, y, z]) => basis(x, y, z));
  const before = DIRECTIONS.map(([x, y, z]) =>
    basis(
      turn[0] * x + turn[3] * y + turn[6] * z,
      turn[1] * x + turn[4] * y + turn[7] * z,
      turn[2] * x + turn[5] * y + turn[8] * z,
    ),
  );
  const inner = (a: number[][], b: number[][], row: number, column: number): number =>
    a.reduce((sum, values, k) => sum + values[row] * b[k][column], 0);
  const matrix = (b: number[][]): number[][] =>
    Array.from({ length: size }, (_, row) =>
      Array.from({ length: size }, (__, column) => inner(after, b, row, column)),
    );
  return solve(matrix(after), matrix(before));
}

/** Solves A·X = B for a positive definite A by elimination, and returns X, row-major. Modifies `a` and `b`. */
function solve(a: number[][], b: number[][]): Float64Array {
  const size = a.length;
  for (let pivot = 0; pivot < size; pivot++) {
    for (let row = 0; row < size; row++) {
      if (row === pivot) continue;
      const factor = a[row][pivot] / a[pivot][pivot];
      for (let k = 0; k < size; k++) {
        a[row][k] -= factor * a[pivot][k];
        b[row][k] -= factor * b[pivot][k];
      }
    }
  }
  return Float64Array.from(
    { length: size * size },
    (_, k) => b[Math.floor(k / size)][k % size] / a[Math.floor(k / size)][Math.floor(k / size)],
  );
}
