/** The renderer's float image of a cloud, held against the oracle's. */
import type { Camera, GaussianCloud } from '@gaussian-splat/core';
import { GaussianBuffers, packGaussians } from '@gaussian-splat/renderer';
import { renderOracle, type Mode, type OracleImage } from '../oracle/oracle.js';
import { maxAbs, percentile, psnr } from './metrics.js';
import { capture, Renderer, type RendererOptions } from './renderer.js';

/** How close an image is to the oracle's, over the pixels that any splat covers, before any rounding to 8 bits. */
export interface Closeness {
  /** Peak 1, dB. */
  readonly psnr: number;
  /** Same, over all pixels. */
  readonly psnrAll: number;
  /** Absolute difference that 99.9 % of the channels do not exceed. */
  readonly p999: number;
  readonly max: number;
}

/** The renderer's image: [height, width, 4] premultiplied float32. */
export async function renderCloud(
  device: GPUDevice,
  cloud: GaussianCloud,
  camera: Camera,
  mode: Mode,
  options?: RendererOptions,
): Promise<Float32Array> {
  const renderer = new Renderer(device, options);
  const gaussians = await GaussianBuffers.upload(
    device,
    packGaussians({ ...cloud, antialiased: mode === 'antialiased' }),
  );
  try {
    return await capture(device, renderer, { gaussians, camera });
  } finally {
    renderer.destroy();
    gaussians.destroy();
  }
}

/** Compares an image over black with the oracle's: color, and alpha as a fourth channel. */
export function closeness(pixels: Float32Array, oracle: OracleImage): Closeness {
  const expected = new Float64Array(pixels.length);
  const covered = oracle.contributors;
  for (let i = 0; i < covered.length; i++) {
    expected.set(oracle.color.subarray(3 * i, 3 * i + 3), 4 * i);
    expected[4 * i + 3] = 1 - oracle.transmittance[i];
  }
  const options = { mask: covered, channels: 4 };
  return {
    psnr: psnr(pixels, expected, options),
    psnrAll: psnr(pixels, expected, { channels: 4 }),
    p999: percentile(pixels, expected, 0.999, options),
    max: maxAbs(pixels, expected, { channels: 4 }),
  };
}

/** Draws a view with both and compares. The oracle follows the gsplat rules. */
export async function compareWithOracle(
  device: GPUDevice,
  cloud: GaussianCloud,
  camera: Camera,
  mode: Mode,
  options?: RendererOptions,
): Promise<Closeness> {
  const pixels = await renderCloud(device, cloud, camera, mode, options);
  return closeness(pixels, renderOracle(cloud, camera, { rules: 'gsplat', mode }));
}

/** A line of a table: name, dB over covered and over all pixels, 99.9th percentile and worst in 1/255. */
export function describeCloseness(name: string, { psnr, psnrAll, p999, max }: Closeness): string {
  const numbers = [
    `${psnr.toFixed(2)} dB`,
    `${psnrAll.toFixed(2)} dB all`,
    `p99.9 ${(255 * p999).toFixed(3)}`,
    `max ${(255 * max).toFixed(2)}`,
  ];
  return `${name.padEnd(40)} ${numbers.map((n) => n.padStart(14)).join(' ')}`;
}
