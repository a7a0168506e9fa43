/** The point of a ray at which a splat is densest: the depths of an order for each pixel (Radl et al. 2024), of the splat as it is painted, filter included. */
import type { Camera, GaussianCloud, Vector3 } from '@gaussian-splat/core';
import { linearPart, rotationTimesScale, type Ellipse } from './projection.js';
import type { Rules } from './rules.js';

/** For splat `i` with its center at `center` in camera axes: the depth of its maximum along the ray of a pixel, 0 if that is behind the camera. @param ellipse the drawn one, by whose size a splat far outside of the image differs. */
export function densestDepth(
  cloud: GaussianCloud,
  i: number,
  camera: Camera,
  center: Vector3,
  rules: Rules,
  ellipse?: Ellipse,
): (column: number, row: number) => number {
  const { fx, fy, cx, cy, orthographic } = camera;
  const [x, y, z] = center;
  const axes = rotationTimesScale(cloud, i);
  const turned = linearPart(camera).map((row) =>
    [0, 1, 2].map((k) => row[0] * axes[0][k] + row[1] * axes[1][k] + row[2] * axes[2][k]),
  );
  const covariance = turned.map((a) => turned.map((b) => dot(a, b)));
  // The filter widens the image across and down by its variance in pixels: a Gaussian of the size of that at the splat's depth.
  const shrink = orthographic ? 1 : z;
  covariance[0][0] += rules.dilation * (shrink / fx) ** 2;
  covariance[1][1] += rules.dilation * (shrink / fy) ** 2;
  // A shape that is flat along the ray has no inverse if the filter adds nothing: a tiny value makes it invertible.
  const thickness = 1e-14 * (covariance[0][0] + covariance[1][1] + covariance[2][2]);
  for (const k of [0, 1, 2]) covariance[k][k] += thickness;
  const inverse = inverse3(covariance);
  if (orthographic) {
    // Along (dx, dy, t) from the center the exponent has its minimum at the zero of its derivative by t.
    const [a, b, c] = inverse[2];
    return (column, row) => Math.max(0, z - (a * ((column + 0.5 - cx) / fx - x) + b * ((row + 0.5 - cy) / fy - y)) / c);
  }
  const toCenter = inverse.map((row) => dot(row, center));
  const whole = dot(center, toCenter);
  return (column, row) => {
    const ray = [(column + 0.5 - cx) / fx, (row + 0.5 - cy) / fy, 1];
    if (ellipse) {
      // The same for a splat in view: rayᵀ A ray is that of the center's ray, along it, and the ellipse's distance across.
      const share = (dot(ray, toCenter) * z) / whole;
      return Math.max(0, (z * share) / (share * share + distance2(ellipse, column, row) / whole));
    }
    // (t·ray - center)ᵀ A (t·ray - center) is least at t = rayᵀ A center / rayᵀ A ray.
    return Math.max(
      0,
      dot(ray, toCenter) /
        dot(
          ray,
          inverse.map((line) => dot(line, ray)),
        ),
    );
  };
}

/** Squared distance of a pixel's center from that of an ellipse, in standard deviations. */
function distance2({ conic: { xx, xy, yy }, x, y }: Ellipse, column: number, row: number): number {
  const [dx, dy] = [column + 0.5 - x, row + 0.5 - y];
  return xx * dx * dx + 2 * xy * dx * dy + yy * dy * dy;
}

function inverse3([a, b, c]: number[][]): number[][] {
  const rows = [cross(b, c), cross(c, a), cross(a, b)];
  const determinant = dot(a, rows[0]);
  return [0, 1, 2].map((k) => rows.map((row) => row[k] / determinant));
}

const cross = (a: readonly number[], b: readonly number[]): number[] => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];
const dot = (a: readonly number[], b: readonly number[]): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
