import { eyeOf, lookAt, multiply, type Camera, type GaussianCloud } from '@gaussian-splat/core';
import { capture } from '../capture.js';
import { GaussianBuffers } from '../gaussian-buffers.js';
import { constants } from '../generated/shaders.js';
import { turn } from '../gpu/page-thread.js';
import { packKept, type PackedGaussians } from '../pack/pack.js';
import type { GaussianScene } from '../gaussian-scene.js';
import type { FrameSettings } from '../frame-target.js';
import { Viewpoint } from '../viewpoint.js';
import { World } from '../world.js';
import { sumsAndSorts } from './stages-alone.js';
import type { ShPrecision } from '../pack/words.js';

/** Maximum error of a pixel: float16 blending stays a tenth below it. */
const TOLERANCE = 0.02;
/** Maximum mean squared error of the self-test, 59 dB PSNR. */
const MAX_ERROR = 10 ** -5.9;
/**
 * Maximum mean error of colors. Blending that rounds to nearest has 1e-6, a float16 that truncates 1e-4: an error of one
 * sign grows with the number of layers, to 42 dB PSNR inside a room.
 */
const MAX_BIAS = 2e-5;
/** Number of large splats, which cover much of the image. */
const LARGE = 24;
/**
 * Number of small splats: each stage has several workgroups, the last of them partly filled, and the sort has two
 * blocks. A third of the splats is outside the image.
 */
const SMALL = 4_500;
/** Several bins of tiles in each direction, the last of them partly outside. */
const [WIDTH, HEIGHT] = [276, 136];
/** Key widths in motion (a fraction of the visible depth range) and at rest (depths). */
const KEY_BITS = [16, 32] as const;
/** Milliseconds after which the reference yields to other tasks of the page. */
const SLICE_MS = 6;
const { ALPHA_MIN, ALPHA_MAX, DILATION, SH_C0, SH_C1 } = constants;

/** Whether a renderer with these options draws the exact image of two scenes with interleaved splats. */
export const passesSelfTest = async (device: GPUDevice, options: FrameSettings): Promise<boolean> =>
  (await faultOf(device, options)) === undefined;

/** Describes the first error that a renderer with these options makes; undefined if the result is right. */
export async function faultOf(device: GPUDevice, options: FrameSettings): Promise<string | undefined> {
  const threads = options.threads === 'serial' ? 'serial' : 'parallel';
  if (!(await sumsAndSorts(device, threads))) return `${threads} prefix sums or the ${threads} sort`;
  // Each step is a task of its own, because a page that starts has frames to show meanwhile.
  await turn();
  const clouds = [sphereCloud(LARGE, 0.8), sphereCloud(SMALL, 0.08, 2.4)];
  const camera = shearedCamera(WIDTH, HEIGHT);
  const scenes: GaussianBuffers[] = [];
  for (const cloud of clouds) {
    await turn();
    scenes.push(await GaussianBuffers.upload(device, packSpheres(cloud, 'float16')));
  }
  const renderer = viewpointOf(device, scenes, options);
  try {
    const expected = await drawSpheres(clouds, camera);
    for (const depthKeyBits of KEY_BITS) {
      const pixels = await capture(device, renderer, { camera, settings: { ...options, depthKeyBits } });
      if (!isNear(pixels, expected)) return `frames of ${options.rasterizer} in ${options.accumulation}, ${threads}`;
    }
    return undefined;
  } finally {
    renderer.destroy();
    for (const scene of scenes) scene.destroy();
  }
}

/** Whether no pixel has a large error, and the covered ones are accurate on average. */
function isNear(pixels: Float32Array, expected: Float64Array): boolean {
  let [sum, bias, covered] = [0, 0, 0];
  for (let i = 0; i < pixels.length; i++) {
    const error = pixels[i] - expected[i];
    // NaN fails the comparison, too.
    if (!(Math.abs(error) <= TOLERANCE)) return false;
    sum += error * error;
    if (i % 4 < 3) bias += error;
    if (expected[i | 3] > 0) covered++;
  }
  return sum <= MAX_ERROR * covered && Math.abs(bias) <= MAX_BIAS * covered;
}

/** A viewpoint of these scenes only. */
export function viewpointOf(device: GPUDevice, scenes: readonly GaussianScene[], settings: FrameSettings): Viewpoint {
  const world = new World();
  for (const scene of scenes) world.add({ scene });
  return new Viewpoint(device, world, { settings });
}

/** A camera at an oblique angle, so that a transposed matrix is detected. */
export function probeCamera(width: number, height: number): Camera {
  const worldToCamera = lookAt([1.2, -0.8, -2.6], [0.1, 0.05, 0], [0.1, -1, 0.2]);
  const focal = 1.1 * width;
  return { width, height, fx: focal, fy: focal, cx: width / 2, cy: height / 2, worldToCamera, near: 0.2, far: 100 };
}

/** The same camera, sheared: spheres become slanted ellipses, so that a lost slope is detected, too. */
function shearedCamera(width: number, height: number): Camera {
  const camera = probeCamera(width, height);
  const shear = [1, 0.7, 0, 0, 0, 0.6, 0.2, 0, 0, 0, 1, 0, 0, 0, 0, 1];
  return { ...camera, worldToCamera: multiply(shear, camera.worldToCamera) };
}

/**
 * Spheres of random position, size, opacity and view-dependent color; the same on every machine.
 * @param side Side of the cube around their centers.
 */
export function sphereCloud(count: number, size: number, side = 1.6): GaussianCloud {
  let state = 1;
  const random = (): number => (state = (state * 48271) % 0x7fffffff) / 0x7fffffff;
  const fill = (length: number, value: (i: number) => number): Float32Array =>
    Float32Array.from({ length }, (_, i) => value(i));
  const radii = fill(count, () => size * (0.02 + 0.1 * random()));
  return {
    count,
    shDegree: 1,
    antialiased: false,
    origin: [0, 0, 0],
    droppedCount: 0,
    positions: fill(3 * count, () => side * (random() - 0.5)),
    scales: fill(3 * count, (i) => radii[Math.floor(i / 3)]),
    rotations: fill(4 * count, (i) => (i % 4 === 0 ? 1 : 0)),
    opacities: fill(count, () => 0.2 + 0.75 * random()),
    sh: fill(12 * count, (i) => (i % 12 < 3 ? 2.4 * (random() - 0.5) : 0.3 * (random() - 0.5))),
  };
}

/**
 * Packs valid spheres as `packGaussians` does. The base bundle contains this function; the checks of untrusted clouds
 * are loaded only with a file reader.
 * @param order Order of the splats; `packGaussians` uses that of `mortonOrder`.
 */
export function packSpheres(
  cloud: GaussianCloud,
  shPrecision: ShPrecision,
  order: Uint32Array = new Uint32Array(cloud.count).map((_, i) => i),
): PackedGaussians {
  const { count, shDegree, antialiased, filterVariance, origin, droppedCount } = cloud;
  return {
    count,
    shDegree,
    shPrecision,
    antialiased,
    filterVariance,
    origin,
    droppedCount,
    ...packKept(cloud, order, shPrecision),
  };
}

/**
 * Computes the image in float64, front to back: spheres have closed forms. Yields to other tasks of the page every
 * {@link SLICE_MS}.
 */
async function drawSpheres(clouds: readonly GaussianCloud[], camera: Camera): Promise<Float64Array> {
  await turn();
  let end = performance.now() + SLICE_MS;
  const { width, height, near } = camera;
  const pixels = new Float64Array(4 * width * height).map((_, i) => (i % 4 === 3 ? 1 : 0));
  const eye = eyeOf(camera.worldToCamera);
  const spheres = clouds.flatMap((cloud) =>
    Array.from({ length: cloud.count }, (_, i) => projectSphere(cloud, i, camera, eye)),
  );
  const visible = spheres.filter(({ depth }) => depth >= near);
  for (const sphere of visible.sort((a, b) => a.depth - b.depth)) {
    drawSphere(pixels, sphere, camera);
    if (performance.now() < end) continue;
    await turn();
    end = performance.now() + SLICE_MS;
  }
  return pixels.map((value, i) => (i % 4 === 3 ? 1 - value : value));
}

function drawSphere(pixels: Float64Array, sphere: Sphere, { width, height }: Camera): void {
  const { x, y, xx, xy, yy, opacity, color } = sphere;
  const reach = Math.sqrt(2 * Math.log(opacity / ALPHA_MIN));
  const [across, down] = [reach * Math.sqrt(xx), reach * Math.sqrt(yy)];
  const lastRow = Math.min(height - 1, Math.floor(y + down));
  const lastColumn = Math.min(width - 1, Math.floor(x + across));
  const scale = -0.5 / (xx * yy - xy * xy);
  for (let row = Math.max(0, Math.floor(y - down)); row <= lastRow; row++) {
    const dy = row + 0.5 - y;
    for (let column = Math.max(0, Math.floor(x - across)); column <= lastColumn; column++) {
      const dx = column + 0.5 - x;
      const distance = scale * (yy * dx * dx - 2 * xy * dx * dy + xx * dy * dy);
      const alpha = Math.min(ALPHA_MAX, opacity * Math.exp(distance));
      const i = 4 * (width * row + column);
      const light = pixels[i + 3];
      if (alpha < ALPHA_MIN || light * (1 - alpha) <= 1e-4) continue;
      for (let channel = 0; channel < 3; channel++) pixels[i + channel] += light * alpha * color[channel];
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
  readonly color: readonly number[];
}

function projectSphere(
  { positions, scales, opacities, sh }: GaussianCloud,
  i: number,
  camera: Camera,
  eye: readonly number[],
): Sphere {
  const { width, height, fx, fy, cx, cy, worldToCamera: m } = camera;
  const [px, py, pz] = [positions[3 * i], positions[3 * i + 1], positions[3 * i + 2]];
  const along = (row: number): number => m[row] * px + m[row + 1] * py + m[row + 2] * pz + m[row + 3];
  const [x, y, z] = [along(0), along(4), along(8)];
  // The Jacobian is clamped at 1.3 times the edge of the image, whose principal point is the center here.
  const [tx, ty] = [clamp(x / z, (0.65 * width) / fx), clamp(y / z, (0.65 * height) / fy)];
  const [acrossScale, downScale] = [(fx * scales[3 * i]) / z, (fy * scales[3 * i]) / z];
  let [xx, xy, yy] = [DILATION, 0, DILATION];
  for (let c = 0; c < 3; c++) {
    const across = acrossScale * (m[c] - tx * m[8 + c]);
    const down = downScale * (m[4 + c] - ty * m[8 + c]);
    xx += across * across;
    xy += across * down;
    yy += down * down;
  }
  const [dx, dy, dz] = [px - eye[0], py - eye[1], pz - eye[2]];
  const away = Math.hypot(dx, dy, dz);
  const colorOf = (channel: number): number => {
    const at = 12 * i + channel;
    const linear = (-dy * sh[at + 3] + dz * sh[at + 6] - dx * sh[at + 9]) / away;
    return Math.max(0, 0.5 + SH_C0 * sh[at] + SH_C1 * linear);
  };
  return {
    ...{ x: (fx * x) / z + cx, y: (fy * y) / z + cy, depth: z },
    ...{ xx, xy, yy, opacity: opacities[i] },
    color: [colorOf(0), colorOf(1), colorOf(2)],
  };
}

const clamp = (value: number, max: number): number => Math.min(max, Math.max(-max, value));
