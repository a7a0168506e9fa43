/** The cost of short depth keys: the figures behind the default of 24 bits (docs/decisions/0006). */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import type { Camera, GaussianCloud } from '@gaussian-splat/core';
import { readScene } from '@gaussian-splat/formats';
import { GaussianBuffers, packGaussians } from '@gaussian-splat/renderer';
import { renderOracle } from '../oracle/oracle.js';
import { referenceViews } from '../support/cameras.js';
import { closeness, describeCloseness } from '../support/compare.js';
import { needsSharedData, sharedFile } from '../support/data.js';
import { endNodeDevice, serialDevice } from '../support/node-device.js';
import { resized, room } from '../support/scenes.js';
import { capture, Renderer } from '../support/renderer.js';

/** The image of a camera that has just turned: only then are the visible splats sorted by short keys. */
async function renderTurning(cloud: GaussianCloud, camera: Camera, depthKeyBits: 16 | 24 | 32): Promise<Float32Array> {
  const device = await serialDevice();
  const gaussians = await GaussianBuffers.upload(device, packGaussians({ ...cloud, antialiased: false }));
  const renderer = new Renderer(device, { depthKeyBits });
  const [x, y, z] = [0, 4, 8].map((row) => Array.from(camera.worldToCamera).slice(row, row + 4));
  // Looking the other way, then as asked: a first frame would order everything exactly.
  const away = [x.map((v) => -v), y, z.map((v) => -v)].flat().concat(0, 0, 0, 1);
  await capture(device, renderer, { gaussians, camera: { ...camera, worldToCamera: away } });
  const pixels = await capture(device, renderer, { gaussians, camera });
  renderer.destroy();
  gaussians.destroy();
  return pixels;
}

/** dB to the oracle with keys of 16, 24 and 32 bits. */
async function sweep(name: string, cloud: GaussianCloud, camera: Camera): Promise<Record<16 | 24 | 32, number>> {
  const oracle = renderOracle(cloud, camera, { rules: 'gsplat', mode: 'classic' });
  const decibel = { 16: 0, 24: 0, 32: 0 };
  for (const depthKeyBits of [16, 24, 32] as const) {
    const pixels = await renderTurning(cloud, camera, depthKeyBits);
    const close = closeness(pixels, oracle);
    console.log(describeCloseness(`${name}, ${depthKeyBits}-bit keys`, close));
    decibel[depthKeyBits] = close.psnr;
  }
  return decibel;
}

function assertEnough(decibel: Record<16 | 24 | 32, number>): void {
  assert.ok(Math.abs(decibel[24] - decibel[32]) < 0.05, `24 bits: ${decibel[24]} dB, 32 bits: ${decibel[32]} dB`);
  // If 16 bits ever cost nothing here, the default should be theirs.
  assert.ok(decibel[16] < decibel[24] - 1, `16 bits: ${decibel[16]} dB, 24 bits: ${decibel[24]} dB`);
}

test('depth keys: a captured scene', { skip: needsSharedData }, async () => {
  const view = referenceViews().find(({ name }) => name === 'playbot3 1')!;
  assertEnough(
    await sweep(view.name, await readScene(sharedFile(view.file), { name: view.file }), resized(view.camera, 320)),
  );
});

test('depth keys: inside a room', async () => {
  const { name, cloud, cameras } = room();
  assertEnough(await sweep(name, cloud, cameras[1]));
});

after(endNodeDevice);
