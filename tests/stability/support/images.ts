/** Drawing for the rows: a scene with either rasterizer, as a still camera or a turning one sees it. */
import type { Camera, GaussianCloud } from '@gaussian-splat/core';
import { GaussianBuffers, packGaussians, type PackOptions, type RasterizerName } from '@gaussian-splat/renderer';
import type { Threads } from '@gaussian-splat/renderer/tools';
import { renderOracle, type Mode, type OracleImage } from '../../oracle/oracle.js';
import { closeness, type Closeness } from '../../support/compare.js';
import { sized } from './row.js';
import { capture, Renderer, type RendererOptions } from '../../support/renderer.js';

export const RASTERIZERS: readonly RasterizerName[] = ['quads', 'tiles'];

/**
 * How stages share their work. Barriers make SwiftShader slow; that both variants draw the same bytes is the concern of
 * tests/golden/variants.lab.test.ts, and whole recipes run with barriers.
 */
export const THREADS = sized<Threads>('serial', 'parallel');

/** The quality that is held to 75 dB. Its harmonics are kept in float16. */
export const REFERENCE: RendererOptions & PackOptions = { quality: 'reference', rasterizer: 'tiles', sh: 'float16' };

/** How an image is drawn: options of the renderer and of packing, and whether the camera has just turned. */
export interface DrawOptions extends RendererOptions, PackOptions {
  readonly mode?: Mode;
  /** Draws another direction first, so that the visible splats are sorted by their short keys. Default false. */
  readonly turning?: boolean;
}

/** [height, width, 4] premultiplied float32. */
export async function draw(
  device: GPUDevice,
  cloud: GaussianCloud,
  camera: Camera,
  { mode = 'classic', turning = false, sh, ...options }: DrawOptions = {},
): Promise<Float32Array> {
  const gaussians = await GaussianBuffers.upload(
    device,
    packGaussians({ ...cloud, antialiased: mode === 'antialiased' }, { sh }),
  );
  const renderer = new Renderer(device, { threads: THREADS, ...options });
  try {
    if (turning) await capture(device, renderer, { gaussians, camera: turnedAway(camera) });
    return await capture(device, renderer, { gaussians, camera });
  } finally {
    renderer.destroy();
    gaussians.destroy();
  }
}

/** The float64 image. */
export const truth = (cloud: GaussianCloud, camera: Camera, mode: Mode = 'classic'): OracleImage =>
  renderOracle(cloud, camera, { rules: 'gsplat', mode });

/** Draws and compares with the float64 image. Over all pixels if no splat covers any. */
export async function compare(
  device: GPUDevice,
  cloud: GaussianCloud,
  camera: Camera,
  options: DrawOptions = {},
): Promise<Closeness> {
  const pixels = await draw(device, cloud, camera, options);
  return compareImage(pixels, truth(cloud, camera, options.mode));
}

/** An image without a covered pixel must be empty: then any difference counts. */
export function compareImage(pixels: Float32Array, oracle: OracleImage): Closeness {
  if (oracle.contributors.some((n) => n > 0)) return closeness(pixels, oracle);
  const worst = pixels.reduce((max, x) => Math.max(max, Number.isFinite(x) ? Math.abs(x) : Infinity), 0);
  return { psnr: -20 * Math.log10(worst), psnrAll: -20 * Math.log10(worst), p999: worst, max: worst };
}

/** The camera turned about its own vertical axis, to the right, by an angle in radians. */
export function yawed({ worldToCamera: m, ...camera }: Camera, angle: number): Camera {
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  const row = (r: number): number[] => Array.from(m).slice(4 * r, 4 * r + 4);
  const [x, y, z] = [row(0), row(1), row(2)];
  const mixed = (a: number, b: number): number[] => x.map((v, k) => a * v + b * z[k]);
  return { ...camera, worldToCamera: [...mixed(c, -s), ...y, ...mixed(s, c), 0, 0, 0, 1] };
}

/** The camera rolled about its line of sight by an angle in radians. */
export function rolled({ worldToCamera: m, ...camera }: Camera, angle: number): Camera {
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  const row = (r: number): number[] => Array.from(m).slice(4 * r, 4 * r + 4);
  const [x, y, z] = [row(0), row(1), row(2)];
  const mixed = (a: number, b: number): number[] => x.map((v, k) => a * v + b * y[k]);
  return { ...camera, worldToCamera: [...mixed(c, -s), ...mixed(s, c), ...z, 0, 0, 0, 1] };
}

/** Looking the other way. */
export const turnedAway = (camera: Camera): Camera => yawed(camera, Math.PI);

/** The same view with another number of pixels across. */
export function resized(camera: Camera, width: number): Camera {
  const s = width / camera.width;
  const height = Math.max(1, Math.round(camera.height * s));
  return { ...camera, width, height, fx: camera.fx * s, fy: camera.fy * s, cx: camera.cx * s, cy: camera.cy * s };
}

/** Number of bytes that differ between two images. */
export function differingBytes(a: Float32Array, b: Float32Array): number {
  const [x, y] = [a, b].map(({ buffer, byteOffset, byteLength }) => Buffer.from(buffer, byteOffset, byteLength));
  if (x.length !== y.length) return Math.max(x.length, y.length);
  if (x.equals(y)) return 0;
  return x.reduce((count, byte, i) => count + (byte === y[i] ? 0 : 1), 0);
}

/** Numbers of an image that are not finite. */
export const notFinite = (pixels: Float32Array): number =>
  pixels.reduce((count, x) => count + (Number.isFinite(x) ? 0 : 1), 0);
