import {
  determinant,
  matrixOfQuaternion,
  multiply3,
  orthogonalFactor,
  quaternionOfMatrix,
  shCoefficientCount,
  symmetricEigen,
  transposed,
  type GaussianCloud,
  type Matrix3,
} from '@gaussian-splat/core';
import { shRotation } from './sh-rotation.js';

/** Relative tolerance within which a matrix is considered a rotation with uniform scale. */
const SIMILARITY = 1e-6;

/** Entries of a rotation of harmonics with a smaller magnitude are considered 0. */
const NEGLIGIBLE = 1e-12;

/**
 * Applies an affine transform to a cloud, in place: to centers, covariances, and the directions of spherical harmonics.
 * A singular transform of rank 2 makes splats discs. One of lower rank sets their scales to 0, so that readers drop them.
 * The origin of the cloud is not transformed.
 *
 * @param map Row-major, [3, 4]: linear part and translation.
 */
export function transformCloud(cloud: GaussianCloud, map: readonly number[]): void {
  const linear = [map[0], map[1], map[2], map[4], map[5], map[6], map[8], map[9], map[10]];
  movePositions(cloud.positions, linear, [map[3], map[7], map[11]]);
  const whole = filled(linear);
  if (whole === undefined) {
    cloud.scales.fill(0);
    return;
  }
  const turn = orthogonalFactor(whole);
  const scale = Math.cbrt(Math.abs(determinant(linear)));
  const isSimilar = linear.every((value, k) => Math.abs(value - scale * turn[k]) <= SIMILARITY * scale);
  if (isSimilar) turnShapes(cloud, turn, scale);
  else deformShapes(cloud, linear);
  turnHarmonics(cloud, turn);
}

/**
 * Returns a regular matrix with the same rotation as `m`: `m` itself, unless it is singular. For rank 2, adds the outer
 * product of the normal of the image and the lost axis, which is proportional to the cofactors. Undefined for lower ranks.
 */
function filled(m: Matrix3): Matrix3 | undefined {
  const volume = determinant(m);
  if (Math.abs(volume) >= 1e-36) return Number.isFinite(volume) ? m : undefined;
  const cofactor = (row: number, column: number): number => {
    const [a, b] = [3 * ((row + 1) % 3), 3 * ((row + 2) % 3)];
    const [c, d] = [(column + 1) % 3, (column + 2) % 3];
    return m[a + c] * m[b + d] - m[a + d] * m[b + c];
  };
  const cofactors = m.map((_, k) => cofactor(Math.floor(k / 3), k % 3));
  const area = Math.hypot(...cofactors);
  return area >= 1e-24 && Number.isFinite(area) ? m.map((v, k) => v + cofactors[k] / Math.sqrt(area)) : undefined;
}

function movePositions(positions: Float32Array, m: Matrix3, [tx, ty, tz]: readonly number[]): void {
  for (let i = 0; i < positions.length; i += 3) {
    const x = positions[i];
    const y = positions[i + 1];
    const z = positions[i + 2];
    positions[i] = m[0] * x + m[1] * y + m[2] * z + tx;
    positions[i + 1] = m[3] * x + m[4] * y + m[5] * z + ty;
    positions[i + 2] = m[6] * x + m[7] * y + m[8] * z + tz;
  }
}

/**
 * Rotates and scales the ellipsoids of splats. `turn` may be a reflection: because an ellipsoid is point-symmetric, the
 * rotation -1 · `turn` gives the same ellipsoid.
 */
function turnShapes({ count, scales, rotations }: GaussianCloud, turn: Matrix3, scale: number): void {
  const sign = Math.sign(determinant(turn));
  const [w, x, y, z] = quaternionOfMatrix(turn.map((value) => sign * value));
  for (let i = 0; i < count; i++) {
    const a = rotations[4 * i];
    const b = rotations[4 * i + 1];
    const c = rotations[4 * i + 2];
    const d = rotations[4 * i + 3];
    rotations[4 * i] = w * a - x * b - y * c - z * d;
    rotations[4 * i + 1] = w * b + x * a + y * d - z * c;
    rotations[4 * i + 2] = w * c - x * d + y * a + z * b;
    rotations[4 * i + 3] = w * d + x * c - y * b + z * a;
  }
  if (scale !== 1) for (let k = 0; k < scales.length; k++) scales[k] *= scale;
}

/** Transforms covariances to M·Σ·Mᵀ, and decomposes them into rotations and scales. */
function deformShapes({ count, scales, rotations }: GaussianCloud, m: Matrix3): void {
  for (let i = 0; i < count; i++) {
    const q = rotations.subarray(4 * i, 4 * i + 4);
    const norm = Math.hypot(q[0], q[1], q[2], q[3]);
    if (!(norm > 0)) continue;
    const axes = multiply3(m, matrixOfQuaternion(q[0] / norm, q[1] / norm, q[2] / norm, q[3] / norm));
    const root = axes.map((value, k) => value * scales[3 * i + (k % 3)]);
    const { values, vectors } = symmetricEigen(multiply3(root, transposed(root)));
    if (!values.every(Number.isFinite)) continue;
    values.forEach((value, k) => (scales[3 * i + k] = Math.sqrt(Math.max(0, value))));
    rotations.set(quaternionOfMatrix(vectors), 4 * i);
  }
}

function turnHarmonics(cloud: GaussianCloud, turn: Matrix3): void {
  const bands = ([1, 2, 3] as const).filter((band) => band <= cloud.shDegree);
  const rotations = bands.map((band) => shRotation(band, turn));
  const signs = rotations.map((matrix, k) => signsOf(matrix, 2 * bands[k] + 1));
  if (signs.every((band) => band !== undefined)) return flipHarmonics(cloud, [1, ...signs.flat()]);
  bands.forEach((band, k) => turnBand(cloud, band, rotations[k]));
}

/**
 * Returns the diagonal of a rotation of harmonics that only changes signs, as for half turns. Undefined for other
 * rotations.
 */
function signsOf(matrix: Float64Array, size: number): number[] | undefined {
  const diagonal = Array.from({ length: size }, (_, k) => Math.sign(matrix[k * size + k]));
  const isDiagonal = matrix.every((value, at) => {
    const [row, column] = [Math.floor(at / size), at % size];
    return Math.abs(value - (row === column ? diagonal[row] : 0)) <= NEGLIGIBLE;
  });
  return isDiagonal ? diagonal : undefined;
}

function flipHarmonics({ count, sh }: GaussianCloud, signs: readonly number[]): void {
  const factors = Float32Array.from({ length: 3 * signs.length }, (_, k) => signs[Math.floor(k / 3)]);
  for (let i = 0, at = 0; i < count; i++) {
    for (let k = 0; k < factors.length; k++, at++) sh[at] *= factors[k];
  }
}

function turnBand({ count, sh, shDegree }: GaussianCloud, band: number, matrix: Float64Array): void {
  const stride = 3 * shCoefficientCount(shDegree);
  const old = new Float64Array(21);
  const size = 2 * band + 1;
  // Zeros are skipped: quarter turns between axis conventions have only one or two other entries in each row.
  const terms = Array.from({ length: size }, (_, row) =>
    Array.from({ length: size }, (_, k) => ({ k, factor: matrix[row * size + k] })).filter(
      ({ factor }) => Math.abs(factor) > NEGLIGIBLE,
    ),
  );
  for (let i = 0; i < count; i++) {
    const at = i * stride + 3 * band * band;
    for (let k = 0; k < 3 * size; k++) old[k] = sh[at + k];
    for (let row = 0; row < size; row++) {
      for (let channel = 0; channel < 3; channel++) {
        let sum = 0;
        for (const { k, factor } of terms[row]) sum += factor * old[3 * k + channel];
        sh[at + 3 * row + channel] = sum;
      }
    }
  }
}
