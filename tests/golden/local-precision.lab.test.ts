/** Precision of harmonics is chosen by each part of a scene, not by its mean: see `choosePrecision`. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import type { GaussianCloud } from '@gaussian-splat/core';
import { GaussianBuffers, packGaussians } from '@gaussian-splat/renderer';
import { renderOracle } from '../oracle/oracle.js';
import { cloudOf, repeat } from '../support/clouds.js';
import { closeness } from '../support/compare.js';
import { anyDevice, endNodeDevice } from '../support/node-device.js';
import { seededRandom } from '../support/random.js';
import { cameraAt } from '../support/scenes.js';
import { capture, Renderer } from '../support/renderer.js';

/** A small thing that shines by strong harmonics, among a hundred times as many dull splats elsewhere. */
function shinyThing(strength: number): GaussianCloud {
  const random = seededRandom(3);
  const within = (low: number, high: number): number => random.uniform(low, high);
  const shiny = repeat(400, () => ({
    position: [within(-0.3, 0.3), within(-0.3, 0.3), within(3, 3.3)] as const,
    scale: 0.05,
    opacity: 0.95,
    color: [0.5, 0.5, 0.5] as const,
    sh: Array.from({ length: 45 }, () => strength * within(-1, 1)),
  }));
  const dull = repeat(40_000, () => ({
    position: [within(20, 40), within(-10, 10), within(20, 40)] as const,
    scale: 0.2,
    opacity: 0.9,
    color: [0.5, 0.5, 0.5] as const,
    sh: Array.from({ length: 45 }, () => 0.02 * within(-1, 1)),
  }));
  return cloudOf([...shiny, ...dull], 3);
}

test('a small part that shines is as exact as the dull rest', async () => {
  const device = await anyDevice();
  const cloud = shinyThing(2.5);
  const packed = packGaussians(cloud);
  assert.equal(packed.shPrecision, 'float16');
  const gaussians = await GaussianBuffers.upload(device, packed);
  const renderer = new Renderer(device, { rasterizer: 'quads' });
  const camera = cameraAt([0, 0, 0], [0, 0, 3], { width: 96, height: 96, fovXDegrees: 11 });
  const found = await capture(device, renderer, { gaussians, camera });
  const { psnr } = closeness(found, renderOracle(cloud, camera, { rules: 'gsplat', mode: 'classic' }));
  assert.ok(psnr >= 59, `${psnr} dB`);
  renderer.destroy();
  gaussians.destroy();
});

test('a thing that shines but little stays small', () => {
  assert.equal(packGaussians(shinyThing(0.3)).shPrecision, 'int8');
});

after(endNodeDevice);
