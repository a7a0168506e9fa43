/** Test of scene files against photographs: a file passes if it loses little in comparison with the whole scene. */
import { spawnSync } from 'node:child_process';
import { mkdirSync, mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { capture, GaussianBuffers, packGaussians, Viewpoint, World } from '@gaussian-splat/renderer';
import { UsageError } from '../command.mjs';
import { encodePng, toBytes } from '../draw-scene.mjs';
import { LIMITS, verdictOf } from './verdicts.mjs';

export { LIMITS };

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

  /** Returns the metrics of each photograph. `lpips` is null in all of them if it cannot be measured. */
  async #measure(cloud, name) {
    const folder = this.#folder ? join(this.#folder, name.replace(/\W+/g, '-')) : mkdtempSync(join(tmpdir(), 'gate-'));
    try {
      const images = await drawPngs(this.#device, cloud, this.#photographs, folder);
      const pairs = images.map((image, k) => [image, this.#photographs[k].photograph]);
      return runMetrics(this.#python, pairs).rows;
    } finally {
      if (!this.#folder) rmSync(folder, { recursive: true });
    }
  }

  /**
   * Returns the mean metrics of a cloud, its mean losses relative to the first cloud with their standard errors over the
   * photographs, and the verdict; see {@link verdictOf}. `views` has the losses of each photograph.
   */
  async judge(cloud, name) {
    const rows = await this.#measure(cloud, name);
    this.#whole ??= rows;
    const hasLpips = rows[0].lpips !== null;
    const views = Object.fromEntries(
      Object.keys(LIMITS)
        .filter((key) => key !== 'lpips' || hasLpips)
        .map((key) => [key, rows.map((row, k) => (this.#whole[k][key] - row[key]) * (key === 'lpips' ? -1 : 1))]),
    );
    const mean = (key) => rows.reduce((sum, row) => sum + row[key], 0) / rows.length;
    const figures = { psnr: mean('psnr'), ssim: mean('ssim'), lpips: hasLpips ? mean('lpips') : undefined };
    const { lost, errors, verdict } = verdictOf(views);
    const description = describe(figures, lost, errors, verdict);
    return { figures, lost, errors, views, verdict, passes: verdict === 'passes', description };
  }
}

function describe({ psnr, ssim, lpips }, lost, errors, verdict) {
  const change = (key, sign, digits) => {
    const value = sign * lost[key];
    return `(${value < 0 ? '' : '+'}${value.toFixed(digits)} ± ${errors[key].toFixed(digits)})`;
  };
  const losses = [
    `${psnr.toFixed(2)} dB ${change('psnr', -1, 3)}`,
    `SSIM ${ssim.toFixed(4)} ${change('ssim', -1, 4)}`,
    lpips === undefined ? 'LPIPS not measured' : `LPIPS ${lpips.toFixed(4)} ${change('lpips', 1, 4)}`,
  ];
  return `${verdict}: ${losses.join(', ')}`;
}
