/** Test of scene files against photographs: a file passes if it loses little in comparison with the whole scene. */
import { spawnSync } from 'node:child_process';
import { mkdirSync, mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { capture, GaussianBuffers, packGaussians, Viewpoint, World } from '@gaussian-splat/renderer';
import { UsageError } from '../command.mjs';
import { encodePng, toBytes } from '../draw-scene.mjs';

/** Maximum mean losses over all photographs: PSNR in dB, SSIM and LPIPS. The limits are those of splat-compression-bench. */
export const LIMITS = { psnr: 0.2, ssim: 0.002, lpips: 0.005 };

/**
 * Returns the PSNR of a file against the whole scene, in dB, with which it loses 0.2 dB against photographs. This assumes
 * that the error of the file and that of the scene are independent, so that their mean squares add up.
 * @param psnr PSNR of the whole scene against the photographs, in dB.
 */
export const neededDecibels = (psnr) => psnr - 10 * Math.log10(10 ** (LIMITS.psnr / 10) - 1);

const SCRIPT = fileURLToPath(new URL('metrics.py', import.meta.url));
const REQUIREMENTS = fileURLToPath(new URL('requirements.txt', import.meta.url));

/**
 * Runs metrics.py on pairs of paths, an image and its photograph. Returns `rows`, with the metrics of each pair, and
 * `withoutLpips`, the reason why `lpips` is null in all of them, else null.
 * @throws UsageError if Python or one of its packages is missing.
 */
export function runMetrics(python, pairs) {
  const { status, stdout, stderr, error } = spawnSync(python, [SCRIPT], {
    input: JSON.stringify({ pairs }),
    encoding: 'utf8',
  });
  if (status === 0) return JSON.parse(stdout);
  const reason = error?.message ?? stderr.trim().split('\n').at(-1);
  throw new UsageError(`${python}: ${reason}. Install its packages: pip install -r ${REQUIREMENTS}`);
}

/**
 * Checks before the work that a Python has the required packages.
 * @returns The reason why it cannot measure LPIPS; null if it can.
 * @throws UsageError if another package is missing.
 */
export const checkPython = (python) => runMetrics(python, []).withoutLpips;

/** Draws a cloud from the cameras of photographs over black, as training does. Returns the paths of the PNG files. */
export async function drawPngs(device, cloud, photographs, folder) {
  mkdirSync(folder, { recursive: true });
  const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud));
  const world = new World();
  world.add({ scene: gaussians });
  const viewpoint = new Viewpoint(device, world);
  const paths = [];
  try {
    for (const { id, camera } of photographs) {
      const pixels = await capture(device, viewpoint, { camera, background: [0, 0, 0, 1] });
      paths.push(join(folder, `${id}.png`));
      writeFileSync(paths.at(-1), encodePng(toBytes(pixels), camera.width, camera.height));
    }
  } finally {
    viewpoint.destroy();
    gaussians.destroy();
  }
  return paths;
}

/** Test of clouds against photographs. Losses are relative to the first cloud that is judged. */
export class Gate {
  #device;
  #photographs;
  #python;
  #folder;
  #whole;

  /**
   * @param options.photographs Result of {@link readPhotographs}.
   * @param options.python {string} Path of a Python with the packages of requirements.txt.
   * @param options.folder {string | undefined} Folder that keeps the images of each cloud. By default, they are
   * removed.
   */
  constructor(device, { photographs, python, folder }) {
    this.#device = device;
    this.#photographs = photographs;
    this.#python = python;
    this.#folder = folder;
  }

  /** Returns the means of the metrics over the photographs. `lpips` is undefined if it cannot be measured. */
  async #measure(cloud, name) {
    const folder = this.#folder ? join(this.#folder, name.replace(/\W+/g, '-')) : mkdtempSync(join(tmpdir(), 'gate-'));
    try {
      const images = await drawPngs(this.#device, cloud, this.#photographs, folder);
      const pairs = images.map((image, k) => [image, this.#photographs[k].photograph]);
      const { rows } = runMetrics(this.#python, pairs);
      const mean = (key) => rows.reduce((sum, row) => sum + row[key], 0) / rows.length;
      return { psnr: mean('psnr'), ssim: mean('ssim'), lpips: rows[0].lpips === null ? undefined : mean('lpips') };
    } finally {
      if (!this.#folder) rmSync(folder, { recursive: true });
    }
  }

  /**
   * Returns the metrics of a cloud, its losses relative to the first cloud, and whether all measured losses are below
   * {@link LIMITS}.
   */
  async judge(cloud, name) {
    const figures = await this.#measure(cloud, name);
    this.#whole ??= figures;
    const whole = this.#whole;
    const lost = {
      psnr: whole.psnr - figures.psnr,
      ssim: whole.ssim - figures.ssim,
      lpips: figures.lpips === undefined ? undefined : figures.lpips - whole.lpips,
    };
    const passes = Object.entries(LIMITS).every(([key, max]) => lost[key] === undefined || lost[key] < max);
    return { figures, lost, passes, description: describe(figures, lost, passes) };
  }
}

function describe({ psnr, ssim, lpips }, lost, passes) {
  const signed = (value, digits) => `${value < 0 ? '' : '+'}${value.toFixed(digits)}`;
  const losses = [
    `${psnr.toFixed(2)} dB (${signed(-lost.psnr, 3)})`,
    `SSIM ${ssim.toFixed(4)} (${signed(-lost.ssim, 4)})`,
    lpips === undefined ? 'LPIPS not measured' : `LPIPS ${lpips.toFixed(4)} (${signed(lost.lpips, 4)})`,
  ];
  return `${passes ? 'passes' : 'fails'}: ${losses.join(', ')}`;
}
