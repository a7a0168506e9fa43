import type { ShDegree } from '@gaussian-splat/core';

/** The real spherical harmonics up to a degree at a unit direction, with the signs of 3D Gaussian Splatting. */
export function shBasis(degree: ShDegree, x: number, y: number, z: number, out: Float64Array): Float64Array {
  out[0] = 0.28209479177387814;
  if (degree >= 1) {
    const a = 0.4886025119029199;
    out[1] = -a * y;
    out[2] = a * z;
    out[3] = -a * x;
  }
  if (degree >= 2) {
    const a = 1.0925484305920792;
    out[4] = a * x * y;
    out[5] = -a * y * z;
    out[6] = 0.31539156525252005 * (2 * z * z - x * x - y * y);
    out[7] = -a * x * z;
    out[8] = (a / 2) * (x * x - y * y);
  }
  if (degree >= 3) {
    const [a, b] = [0.5900435899266435, 0.4570457994644658];
    const ring = 4 * z * z - x * x - y * y;
    out[9] = -a * y * (3 * x * x - y * y);
    out[10] = 2.890611442640554 * x * y * z;
    out[11] = -b * y * ring;
    out[12] = 0.3731763325901154 * z * (2 * z * z - 3 * x * x - 3 * y * y);
    out[13] = -b * x * ring;
    out[14] = 1.445305721320277 * z * (x * x - y * y);
    out[15] = -a * x * (x * x - 3 * y * y);
  }
  return out;
}
