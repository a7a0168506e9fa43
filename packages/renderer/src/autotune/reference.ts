/** Computes the expected image of the self-test on the CPU, in float64. The projection of its spheres has a closed form. */
import { eyeOf, type Camera, type GaussianCloud } from '@gaussian-splat/core';
import { constants } from '../generated/shaders.js';
import { turn } from '../gpu/page-thread.js';

/** Interval of the computed rows. It has no common factor with the height of tiles, so that every row of tiles occurs. */
export const ROW_STEP = 3;
/** Milliseconds after which the computation yields to other tasks of the page, and the number of spheres between checks. */
const SLICE_MS = 6;
const AT_ONCE = 128;
/** Maximum pixels from the edge of the image to the center of a drawn sphere. */
const MARGIN = 60;
const { ALPHA_MIN, ALPHA_MAX, DILATION, SH_C0, SH_C1 } = constants;

/**
 * Computes every {@link ROW_STEP}th row of an image from the first one on, front to back.
 * @returns [ceil(height / ROW_STEP), width, 4] premultiplied red, green, blue and alpha.
 */
export async function drawReference(clouds: readonly GaussianCloud[], camera: Camera): Promise<Float32Array> {
  await turn();
  let end = performance.now() + SLICE_MS;
  const { width, height } = camera;
  const pixels = new Float64Array(4 * width * Math.ceil(height / ROW_STEP));
  // The fourth number of a pixel is its transmittance until all spheres are drawn, then its alpha.
  for (let i = 3; i < pixels.length; i += 4) pixels[i] = 1;
  const eye = eyeOf(camera.worldToCamera);
  const visible: Sphere[] = [];
  for (const cloud of clouds)
    for (let i = 0; i < cloud.count; i++) {
      const sphere = projectSphere(cloud, i, camera, eye);
      if (sphere !== undefined) visible.push(sphere);
    }
  visible.sort((a, b) => a.depth - b.depth);
  for (let i = 0; i < visible.length; i++) {
    drawSphere(pixels, visible[i], camera);
    if (i % AT_ONCE > 0 || performance.now() < end) continue;
    await turn();
    end = performance.now() + SLICE_MS;
  }
  for (let i = 3; i < pixels.length; i += 4) pixels[i] = 1 - pixels[i];
  return new Float32Array(pixels);
}

/** Blends the ellipse of a sphere into the image. Its span in a row is that of the conditional Gaussian for the row. */
function drawSphere(pixels: Float64Array, sphere: Sphere, { width, height }: Camera): void {
  const { x, y, xx, xy, yy, opacity, red, green, blue } = sphere;
  const squaredReach = 2 * Math.log(opacity / ALPHA_MIN);
  const down = Math.sqrt(squaredReach * yy);
  const lastRow = Math.min(height - 1, Math.floor(y - 0.5 + down));
  const variance = xx - (xy * xy) / yy;
  const firstRow = ROW_STEP * Math.ceil(Math.max(0, y - 0.5 - down) / ROW_STEP);
  for (let row = firstRow; row <= lastRow; row += ROW_STEP) {
    const dy = row + 0.5 - y;
    const center = x - 0.5 + (dy * xy) / yy;
    const squaredY = (dy * dy) / yy;
    const across = Math.sqrt((squaredReach - squaredY) * variance);
    const lastColumn = Math.min(width - 1, Math.floor(center + across));
    for (let column = Math.max(0, Math.ceil(center - across)); column <= lastColumn; column++) {
      const dx = column - center;
      const alpha = Math.min(ALPHA_MAX, opacity * Math.exp(-0.5 * (squaredY + (dx * dx) / variance)));
      const i = 4 * ((width * row) / ROW_STEP + column);
      const light = pixels[i + 3];
      if (light * (1 - alpha) <= 1e-4) continue;
      pixels[i] += light * alpha * red;
      pixels[i + 1] += light * alpha * green;
      pixels[i + 2] += light * alpha * blue;
      pixels[i + 3] = light * (1 - alpha);
    }
  }
}

interface Sphere {
  readonly x: number;
  readonly y: number;
  readonly depth: number;
  /** Screen covariance in px². */
  readonly xx: number;
  readonly xy: number;
  readonly yy: number;
  readonly opacity: number;
  readonly red: number;
  readonly green: number;
  readonly blue: number;
}

/** Returns the projection of sphere `i`; undefined if the sphere is outside the image. */
function projectSphere(
  { positions, scales, opacities, sh }: GaussianCloud,
  i: number,
  { width, height, fx, fy, cx, cy, near, worldToCamera: m }: Camera,
  eye: readonly number[],
): Sphere | undefined {
  const px = positions[3 * i];
  const py = positions[3 * i + 1];
  const pz = positions[3 * i + 2];
  const x = m[0] * px + m[1] * py + m[2] * pz + m[3];
  const y = m[4] * px + m[5] * py + m[6] * pz + m[7];
  const z = m[8] * px + m[9] * py + m[10] * pz + m[11];
  const column = (fx * x) / z + cx;
  const row = (fy * y) / z + cy;
  if (z < near || Math.abs(column - cx) > cx + MARGIN || Math.abs(row - cy) > cy + MARGIN) return undefined;
  // The Jacobian is clamped at 1.3 times the edge of the image, whose principal point is the center here.
  const tx = clamp(x / z, (0.65 * width) / fx);
  const ty = clamp(y / z, (0.65 * height) / fy);
  const acrossScale = (fx * scales[3 * i]) / z;
  const downScale = (fy * scales[3 * i]) / z;
  let xx: number = DILATION;
  let xy = 0;
  let yy: number = DILATION;
  for (let c = 0; c < 3; c++) {
    const across = acrossScale * (m[c] - tx * m[8 + c]);
    const down = downScale * (m[4 + c] - ty * m[8 + c]);
    xx += across * across;
    xy += across * down;
    yy += down * down;
  }
  const dx = px - eye[0];
  const dy = py - eye[1];
  const dz = pz - eye[2];
  const slope = SH_C1 / Math.sqrt(dx * dx + dy * dy + dz * dz);
  const first = 12 * i;
  return {
    x: column,
    y: row,
    depth: z,
    xx,
    xy,
    yy,
    opacity: opacities[i],
    red: colorOf(sh, first, dx * slope, dy * slope, dz * slope),
    green: colorOf(sh, first + 1, dx * slope, dy * slope, dz * slope),
    blue: colorOf(sh, first + 2, dx * slope, dy * slope, dz * slope),
  };
}

/** Returns the color of a channel in the direction (x, y, z), whose length is SH_C1. The first coefficient is at `at`. */
const colorOf = (sh: Float32Array, at: number, x: number, y: number, z: number): number =>
  Math.max(0, 0.5 + SH_C0 * sh[at] - y * sh[at + 3] + z * sh[at + 6] - x * sh[at + 9]);

const clamp = (value: number, max: number): number => Math.min(max, Math.max(-max, value));
