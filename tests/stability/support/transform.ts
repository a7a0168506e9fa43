/** Moving clouds by linear maps, in float64, spherical harmonics included: the twin of moving the camera instead. */
import { shCoefficientCount, type GaussianCloud, type Vector3 } from '@gaussian-splat/core';
import { shBasis } from '../../oracle/sh.js';
import { covarianceOf } from '../../support/generator-tensors.js';
import { seededRandom, type Quaternion } from '../../support/random.js';
import { eigenvectors, quaternionOf } from '../../support/symmetric.js';

export type Matrix3 = readonly (readonly number[])[];

export function rotationMatrix([w, x, y, z]: Quaternion): Matrix3 {
  return [
    [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
    [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
    [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
  ];
}

export const apply = (m: Matrix3, v: readonly number[]): Vector3 =>
  m.map((row) => row[0] * v[0] + row[1] * v[1] + row[2] * v[2]) as unknown as Vector3;

/** Row-major 4x4 of a 3x3. */
export const matrix4 = (m: Matrix3): number[] => [...m.flatMap((row) => [...row, 0]), 0, 0, 0, 1];

/** The cloud with every point p moved to M p. Harmonics stay: they are those of the untransformed object. */
export function transformed(cloud: GaussianCloud, m: Matrix3): GaussianCloud {
  const { count, positions } = cloud;
  const out = {
    ...cloud,
    positions: positions.slice(),
    scales: cloud.scales.slice(),
    rotations: cloud.rotations.slice(),
  };
  for (let i = 0; i < count; i++) {
    out.positions.set(apply(m, Array.from(positions.subarray(3 * i, 3 * i + 3))), 3 * i);
    const [xx, xy, xz, yy, yz, zz] = covarianceOf(cloud, i);
    const covariance = [
      [xx, xy, xz],
      [xy, yy, yz],
      [xz, yz, zz],
    ];
    const half = m.map((row) => [0, 1, 2].map((k) => row.reduce((sum, value, j) => sum + value * covariance[j][k], 0)));
    const moved = (a: number, b: number): number => half[a].reduce((sum, value, j) => sum + value * m[b][j], 0);
    const { values, vectors } = eigenvectors([
      moved(0, 0),
      moved(0, 1),
      moved(0, 2),
      moved(1, 1),
      moved(1, 2),
      moved(2, 2),
    ]);
    out.scales.set(
      values.map((value) => Math.sqrt(Math.max(0, value))),
      3 * i,
    );
    out.rotations.set(quaternionOf(vectors), 4 * i);
  }
  return out;
}

/** The cloud whose color along M d equals its former color along d, for a rotation M. */
export function withTurnedHarmonics(cloud: GaussianCloud, rotation: Matrix3): GaussianCloud {
  const size = shCoefficientCount(cloud.shDegree);
  const turn = harmonicsRotation(cloud.shDegree, rotation);
  const sh = new Float32Array(cloud.sh.length);
  for (let i = 0; i < cloud.count; i++) {
    for (let k = 0; k < size; k++) {
      for (let channel = 0; channel < 3; channel++) {
        let sum = 0;
        for (let j = 0; j < size; j++) sum += turn[k][j] * cloud.sh[3 * (size * i + j) + channel];
        sh[3 * (size * i + k) + channel] = sum;
      }
    }
  }
  return { ...cloud, sh };
}

/** [k][j]: how much of basis function j, turned, is basis function k. By least squares over directions, which is exact here. */
function harmonicsRotation(degree: GaussianCloud['shDegree'], rotation: Matrix3): number[][] {
  const size = shCoefficientCount(degree);
  const back = rotation[0].map((_, k) => rotation.map((row) => row[k]));
  const random = seededRandom(20);
  const normal = Array.from({ length: size }, () => new Array<number>(2 * size).fill(0));
  for (let sample = 0; sample < 40 * size; sample++) {
    const direction = random.direction();
    const [here, there] = [shBasis(degree, direction), shBasis(degree, apply(back, direction))];
    for (let k = 0; k < size; k++) {
      for (let j = 0; j < size; j++) {
        normal[k][j] += here[k] * here[j];
        normal[k][size + j] += here[k] * there[j];
      }
    }
  }
  return eliminated(normal, size);
}

/** Gauss and Jordan: solves A X = B for rows [A | B] of a well-conditioned A. */
function eliminated(rows: number[][], size: number): number[][] {
  for (let k = 0; k < size; k++) {
    const pivot = rows[k][k];
    for (let column = 0; column < rows[k].length; column++) rows[k][column] /= pivot;
    for (let other = 0; other < size; other++) {
      if (other === k) continue;
      const factor = rows[other][k];
      for (let column = 0; column < rows[k].length; column++) rows[other][column] -= factor * rows[k][column];
    }
  }
  return rows.map((row) => row.slice(size));
}
