/** Color of a splat seen from a direction: real spherical harmonics up to degree 3, as trainers write them. */
import { shCoefficientCount, type GaussianCloud, type ShDegree, type Vector3 } from '@gaussian-splat/core';

/**
 * The real orthonormal basis functions at a unit direction, ordered by degree and within it by order m = -l..l, with the
 * Condon-Shortley sign (-1)^m. Cartesian forms after Sloan, "Efficient Spherical Harmonic Evaluation", JCGT 2013.
 */
export function shBasis(degree: ShDegree, direction: Vector3): number[] {
  const [x, y, z] = direction;
  const basis = [0.28209479177387814]; // sqrt(1 / 4π)
  if (degree >= 1) {
    const c = 0.4886025119029199; // sqrt(3 / 4π)
    basis.push(-c * y, c * z, -c * x);
  }
  if (degree >= 2) {
    const c = 1.0925484305920792; // sqrt(15 / 4π)
    basis.push(
      c * x * y,
      -c * y * z,
      0.31539156525252005 * (2 * z * z - x * x - y * y), // sqrt(5 / 16π)
      -c * x * z,
      0.5462742152960396 * (x * x - y * y), // sqrt(15 / 16π)
    );
  }
  if (degree >= 3) {
    const c = 0.5900435899266435; // sqrt(35 / 32π)
    const d = 0.4570457994644658; // sqrt(21 / 32π)
    basis.push(
      -c * y * (3 * x * x - y * y),
      2.890611442640554 * x * y * z, // sqrt(105 / 4π)
      -d * y * (4 * z * z - x * x - y * y),
      0.3731763325901154 * z * (2 * z * z - 3 * x * x - 3 * y * y), // sqrt(7 / 16π)
      -d * x * (4 * z * z - x * x - y * y),
      1.445305721320277 * z * (x * x - y * y), // sqrt(105 / 16π)
      -c * x * (x * x - 3 * y * y),
    );
  }
  return basis;
}

/** Red, green and blue of splat `i` seen along a unit direction: 0.5 + Σ c·Y, negative values cut to 0, no upper limit. */
export function splatColor(cloud: GaussianCloud, i: number, direction: Vector3): Vector3 {
  const basis = shBasis(cloud.shDegree, direction);
  const first = 3 * shCoefficientCount(cloud.shDegree) * i;
  const color: [number, number, number] = [0.5, 0.5, 0.5];
  for (let k = 0; k < basis.length; k++) {
    for (let channel = 0; channel < 3; channel++) color[channel] += basis[k] * cloud.sh[first + 3 * k + channel];
  }
  return [Math.max(0, color[0]), Math.max(0, color[1]), Math.max(0, color[2])];
}
