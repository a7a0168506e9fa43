import type { GaussianCloud } from '@gaussian-splat/core';

/**
 * Writes the lower triangular root L of the covariance Σ = L Lᵀ of splat `i` to `out`: xx, yx, yy, zx, zy, zz (world
 * units).
 *
 * L is computed by orthogonalizing the rows of R S, never from Σ itself. Σ contains the squares of the axes, so a
 * needle would lose twice as many digits.
 */
export function scaleRotationFactor({ rotations, scales }: GaussianCloud, i: number, out: Float64Array): void {
  const [sx, sy, sz] = [scales[3 * i], scales[3 * i + 1], scales[3 * i + 2]];
  let [w, x, y, z] = [rotations[4 * i], rotations[4 * i + 1], rotations[4 * i + 2], rotations[4 * i + 3]];
  // Divides by the largest component first, because squares of tiny or huge components would exceed the range of
  // float64.
  const largest = Math.max(Math.abs(w), Math.abs(x), Math.abs(y), Math.abs(z));
  [w, x, y, z] = [w / largest, x / largest, y / largest, z / largest];
  const unit = 1 / Math.sqrt(w * w + x * x + y * y + z * z);
  [w, x, y, z] = [w * unit, x * unit, y * unit, z * unit];

  // Rows of R S.
  const ax = (1 - 2 * (y * y + z * z)) * sx;
  const ay = 2 * (x * y - w * z) * sy;
  const az = 2 * (x * z + w * y) * sz;
  let bx = 2 * (x * y + w * z) * sx;
  let by = (1 - 2 * (x * x + z * z)) * sy;
  let bz = 2 * (y * z - w * x) * sz;
  let cx = 2 * (x * z - w * y) * sx;
  let cy = 2 * (y * z + w * x) * sy;
  let cz = (1 - 2 * (x * x + y * y)) * sz;

  // A row of length 0 is orthogonal to everything, so its inverse length is set to 0.
  const xx = Math.sqrt(ax * ax + ay * ay + az * az);
  const inverseX = xx > 0 ? 1 / xx : 0;
  const yx = (ax * bx + ay * by + az * bz) * inverseX;
  const zx = (ax * cx + ay * cy + az * cz) * inverseX;
  [bx, by, bz] = [bx - yx * ax * inverseX, by - yx * ay * inverseX, bz - yx * az * inverseX];
  [cx, cy, cz] = [cx - zx * ax * inverseX, cy - zx * ay * inverseX, cz - zx * az * inverseX];
  const yy = Math.sqrt(bx * bx + by * by + bz * bz);
  const inverseY = yy > 0 ? 1 / yy : 0;
  const zy = (bx * cx + by * cy + bz * cz) * inverseY;
  [cx, cy, cz] = [cx - zy * bx * inverseY, cy - zy * by * inverseY, cz - zy * bz * inverseY];
  const zz = Math.sqrt(cx * cx + cy * cy + cz * cz);

  out[0] = xx;
  out[1] = yx;
  out[2] = yy;
  out[3] = zx;
  out[4] = zy;
  out[5] = zz;
}
