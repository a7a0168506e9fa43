/**
 * Number of contiguous float64 of a splat during merging, because millions of pairs of near neighbors are compared. The
 * other constants are indices in such a row.
 */
export const ROW = 16;

export const [X, Y, Z] = [0, 1, 2] as const;
/** Entries of the covariance, and its trace. */
export const [XX, YY, ZZ, XY, XZ, YZ, TRACE] = [3, 4, 5, 6, 7, 8, 9] as const;
/** Mean color, from spherical harmonics of degree 0 only. */
export const [RED, GREEN, BLUE] = [10, 11, 12] as const;
/** Weight of a splat in every mean: opacity times area, summed over the original splats that it represents. */
export const MASS = 13;
export const OPACITY = 14;
/** Mean squared displacement of the original splats, in world units². */
export const SPREAD = 15;

/**
 * Returns the area of the splat at `p`, with its variances increased by `low`, in units of 2π: the sum of its
 * projections along the three axes.
 */
export function areaOf(rows: Float64Array, p: number, low = 0): number {
  const xx = rows[p + XX] + low;
  const yy = rows[p + YY] + low;
  const zz = rows[p + ZZ] + low;
  const xy = rows[p + XY];
  const xz = rows[p + XZ];
  const yz = rows[p + YZ];
  return (
    Math.sqrt(Math.max(0, xx * yy - xy * xy)) +
    Math.sqrt(Math.max(0, xx * zz - xz * xz)) +
    Math.sqrt(Math.max(0, yy * zz - yz * yz))
  );
}

/**
 * Writes the covariance of the splat at `p` of `rows`. It is computed from the lower triangular root at `at` of
 * `factors`, in the order xx, yx, yy, zx, zy, zz.
 */
export function covarianceOf(factors: Float32Array | Float64Array, at: number, rows: Float64Array, p: number): void {
  const xx = factors[at];
  const yx = factors[at + 1];
  const yy = factors[at + 2];
  const zx = factors[at + 3];
  const zy = factors[at + 4];
  const zz = factors[at + 5];
  rows[p + XX] = xx * xx;
  rows[p + XY] = xx * yx;
  rows[p + XZ] = xx * zx;
  rows[p + YY] = yx * yx + yy * yy;
  rows[p + YZ] = yx * zx + yy * zy;
  rows[p + ZZ] = zx * zx + zy * zy + zz * zz;
  rows[p + TRACE] = rows[p + XX] + rows[p + YY] + rows[p + ZZ];
}

/**
 * Writes the lower triangular root (Cholesky factor) of a covariance to `out`, from index `at` on. Pivots that rounding
 * has made negative, of flat splats and needles, become zero.
 */
export function factorOf(rows: Float64Array, p: number, out: Float32Array, at: number): void {
  const xx = Math.sqrt(Math.max(0, rows[p + XX]));
  const inverseX = xx > 0 ? 1 / xx : 0;
  const yx = rows[p + XY] * inverseX;
  const zx = rows[p + XZ] * inverseX;
  const yy = Math.sqrt(Math.max(0, rows[p + YY] - yx * yx));
  const zy = yy > 0 ? (rows[p + YZ] - yx * zx) / yy : 0;
  out[at] = xx;
  out[at + 1] = yx;
  out[at + 2] = yy;
  out[at + 3] = zx;
  out[at + 4] = zy;
  out[at + 5] = Math.sqrt(Math.max(0, rows[p + ZZ] - zx * zx - zy * zy));
}

/**
 * Sets the mean and the covariance of the splat at `i` to those of a mixture: the splat at `i` with weight `p`, and the
 * splat at `j` with weight 1 − `p`.
 */
export function joinMoments(rows: Float64Array, i: number, j: number, p: number): void {
  const q = 1 - p;
  const dx = rows[j + X] - rows[i + X];
  const dy = rows[j + Y] - rows[i + Y];
  const dz = rows[j + Z] - rows[i + Z];
  rows[i + XX] = p * rows[i + XX] + q * rows[j + XX] + p * q * dx * dx;
  rows[i + XY] = p * rows[i + XY] + q * rows[j + XY] + p * q * dx * dy;
  rows[i + XZ] = p * rows[i + XZ] + q * rows[j + XZ] + p * q * dx * dz;
  rows[i + YY] = p * rows[i + YY] + q * rows[j + YY] + p * q * dy * dy;
  rows[i + YZ] = p * rows[i + YZ] + q * rows[j + YZ] + p * q * dy * dz;
  rows[i + ZZ] = p * rows[i + ZZ] + q * rows[j + ZZ] + p * q * dz * dz;
  rows[i + TRACE] = rows[i + XX] + rows[i + YY] + rows[i + ZZ];
  rows[i + X] += q * dx;
  rows[i + Y] += q * dy;
  rows[i + Z] += q * dz;
}
