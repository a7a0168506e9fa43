import type { Camera, GaussianCloud } from '@gaussian-splat/core';

/** Filter variance of 3D Gaussian Splatting in px². */
export const DILATION = 0.3;
/** Minimum alpha of a splat in a pixel that renderers draw. */
export const ALPHA_MIN = 1 / 255;
const JACOBIAN_MARGIN = 0.3;

/** Projections of the `count` visible splats. `source` has their indices in the cloud, and `depths` the distances. */
export interface Projected {
  readonly count: number;
  readonly source: Uint32Array;
  readonly depths: Float32Array;
  /** [count, 6] center x and y in pixels, conic xx, xy and yy in 1/px², opacity. */
  readonly ellipses: Float32Array;
  /** [count] half the height in pixels of the bounding box of alpha 1/255 or more. */
  readonly halfHeights: Float32Array;
}

/** Returns the matrix R·S of each splat, row-major, [N, 9]. */
export function factors({ count, rotations, scales }: GaussianCloud): Float32Array {
  const out = new Float32Array(9 * count);
  for (let i = 0; i < count; i++) {
    const [w, x, y, z] = [rotations[4 * i], rotations[4 * i + 1], rotations[4 * i + 2], rotations[4 * i + 3]];
    const [a, b, c] = [scales[3 * i], scales[3 * i + 1], scales[3 * i + 2]];
    const at = 9 * i;
    out[at] = (1 - 2 * (y * y + z * z)) * a;
    out[at + 1] = 2 * (x * y - w * z) * b;
    out[at + 2] = 2 * (x * z + w * y) * c;
    out[at + 3] = 2 * (x * y + w * z) * a;
    out[at + 4] = (1 - 2 * (x * x + z * z)) * b;
    out[at + 5] = 2 * (y * z - w * x) * c;
    out[at + 6] = 2 * (x * z - w * y) * a;
    out[at + 7] = 2 * (y * z + w * x) * b;
    out[at + 8] = (1 - 2 * (x * x + y * y)) * c;
  }
  return out;
}

/** Projects the splats of a cloud that may be visible to a camera. @param roots Result of {@link factors} for the cloud. */
export function project(cloud: GaussianCloud, roots: Float32Array, camera: Camera): Projected {
  const { count, positions, opacities, origin, antialiased, filterVariance = DILATION } = cloud;
  const { fx, fy, cx, cy, width, height, near, far, worldToCamera: m } = camera;
  const source = new Uint32Array(count);
  const depths = new Float32Array(count);
  const ellipses = new Float32Array(6 * count);
  const halfHeights = new Float32Array(count);
  const shift = [3, 7, 11].map((k) => m[k - 3] * origin[0] + m[k - 2] * origin[1] + m[k - 1] * origin[2] + m[k]);
  const [marginX, marginY] = [(JACOBIAN_MARGIN * width) / (2 * fx), (JACOBIAN_MARGIN * height) / (2 * fy)];
  const clamp = (value: number, low: number, high: number): number => Math.min(high, Math.max(low, value));
  let kept = 0;
  for (let i = 0; i < count; i++) {
    const [px, py, pz] = [positions[3 * i], positions[3 * i + 1], positions[3 * i + 2]];
    const z = m[8] * px + m[9] * py + m[10] * pz + shift[2];
    if (!(z > near && z < far)) continue;
    const x = m[0] * px + m[1] * py + m[2] * pz + shift[0];
    const y = m[4] * px + m[5] * py + m[6] * pz + shift[1];
    const slopeX = clamp(x / z, -cx / fx - marginX, (width - cx) / fx + marginX);
    const slopeY = clamp(y / z, -cy / fy - marginY, (height - cy) / fy + marginY);
    let [xx, xy, yy] = [0, 0, 0];
    for (let k = 0; k < 3; k++) {
      const [rx, ry, rz] = [roots[9 * i + k], roots[9 * i + 3 + k], roots[9 * i + 6 + k]];
      const depth = m[8] * rx + m[9] * ry + m[10] * rz;
      const u = (fx / z) * (m[0] * rx + m[1] * ry + m[2] * rz - slopeX * depth);
      const v = (fy / z) * (m[4] * rx + m[5] * ry + m[6] * rz - slopeY * depth);
      xx += u * u;
      xy += u * v;
      yy += v * v;
    }
    const exact = Math.max(0, xx * yy - xy * xy);
    [xx, yy] = [xx + filterVariance, yy + filterVariance];
    const determinant = xx * yy - xy * xy;
    const opacity = opacities[i] * (antialiased ? Math.sqrt(exact / determinant) : 1);
    if (!(opacity >= ALPHA_MIN) || !(determinant > 0)) continue;
    const [centerX, centerY] = [(fx * x) / z + cx, (fy * y) / z + cy];
    const reach = Math.sqrt(2 * Math.log(opacity / ALPHA_MIN));
    const [halfX, halfY] = [reach * Math.sqrt(xx), reach * Math.sqrt(yy)];
    if (!(centerX + halfX > 0 && centerX - halfX < width && centerY + halfY > 0 && centerY - halfY < height)) continue;
    source[kept] = i;
    depths[kept] = z;
    const at = 6 * kept;
    ellipses[at] = centerX;
    ellipses[at + 1] = centerY;
    ellipses[at + 2] = yy / determinant;
    ellipses[at + 3] = -xy / determinant;
    ellipses[at + 4] = xx / determinant;
    ellipses[at + 5] = opacity;
    halfHeights[kept] = halfY;
    kept++;
  }
  return { count: kept, source, depths, ellipses, halfHeights };
}
