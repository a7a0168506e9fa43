/** Images with levels of detail: unchanged without a request, accurate, and with little popping. */
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { after, test } from 'node:test';
import { boundsOf, type Camera, type GaussianCloud } from '@gaussian-splat/core';
import { readScene } from '@gaussian-splat/formats';
import { DetailedGaussians, GaussianBuffers, packGaussians } from '@gaussian-splat/renderer';
import { buildPackedLevels, packWithDetail } from '@gaussian-splat/renderer/tools';
import { psnr } from '../support/metrics.js';
import { endNodeDevice, nodeDevice } from '../support/node-device.js';
import { readFrame } from '../support/read-frame.js';
import { cameraAt } from '../support/scenes.js';
import { pebbles } from '../support/scenes/pebbles.js';
import { Renderer } from '../support/renderer.js';

const size = { width: 120, height: 80, fovXDegrees: 60 };
const serial = { threads: 'serial', sort: 'serial' } as const;

/** Views of the scene's middle from a distance. */
const viewFrom = (distance: number, angle = 0.4): Camera =>
  cameraAt([distance * Math.cos(angle), -0.5 * distance, distance * Math.sin(angle)], [0, 0, 0], size);

async function uploaded(
  cloud: GaussianCloud = pebbles(12_000),
): Promise<{ device: GPUDevice; plain: GaussianBuffers; detailed: GaussianBuffers }> {
  const device = await nodeDevice();
  const [plain, detailed] = await Promise.all([
    GaussianBuffers.upload(device, packGaussians(cloud)),
    GaussianBuffers.upload(device, packWithDetail(cloud)),
  ]);
  return { device, plain, detailed };
}

/** Levels that were added to a scene on the GPU. */
async function added(cloud: GaussianCloud, plain: GaussianBuffers): Promise<DetailedGaussians> {
  const steps = buildPackedLevels(packGaussians(cloud));
  let step = steps.next();
  while (!step.done) step = steps.next();
  return DetailedGaussians.upload(await nodeDevice(), plain, step.value!);
}

test('levels that are added to a scene on the GPU draw what the same levels in one buffer do, and go alone', async () => {
  const cloud = pebbles(6_000);
  const { device, plain, detailed } = await uploaded(cloud);
  const beside = await added(cloud, plain);
  assert.equal(beside.count, plain.count + detailed.count - 256 * Math.ceil(plain.count / 256));
  // The last two have drawn nothing before: an order that was made from elsewhere may have splats of nearly one depth the other way round.
  const renderers = [0, 1, 2, 3].map(() => new Renderer(device, serial));
  for (const [camera, detail] of [[viewFrom(30), 1] as const, [viewFrom(12), 0] as const]) {
    const request = { camera, detail };
    const expected = await readFrame(device, renderers[0], { ...request, gaussians: detailed });
    assert.deepEqual(await readFrame(device, renderers[1], { ...request, gaussians: beside }), expected);
  }
  beside.destroy();
  const camera = viewFrom(12);
  const exact = await readFrame(device, renderers[2], { gaussians: detailed, camera, detail: 0 });
  assert.deepEqual(await readFrame(device, renderers[3], { gaussians: plain, camera }), exact);
  renderers.forEach((renderer) => renderer.destroy());
});

for (const rasterizer of ['quads', 'tiles'] as const) {
  test(`${rasterizer}: without a setting of detail the frame is the same, byte for byte, moving and turning`, async () => {
    const { device, plain, detailed } = await uploaded(pebbles(5_000));
    const accumulation = rasterizer === 'tiles' ? 'rgba32float' : 'rgba16float';
    const renderers = [0, 1].map(() => new Renderer(device, { ...serial, rasterizer, accumulation }));
    for (const camera of [viewFrom(10), viewFrom(2, 0.5)]) {
      const expected = await readFrame(device, renderers[0], { gaussians: plain, camera });
      assert.deepEqual(await readFrame(device, renderers[1], { gaussians: detailed, camera }), expected);
    }
    renderers.forEach((renderer) => renderer.destroy());
  });
}

/** The scene that ships, as it is and with levels of detail, and how far away its camera is. */
interface Skull {
  readonly device: GPUDevice;
  readonly plain: GaussianBuffers;
  readonly detailed: GaussianBuffers;
  readonly away: number;
}

async function loadSkull(): Promise<Skull> {
  const bytes = new Uint8Array(readFileSync(new URL('../../demo/scenes/skull.spz', import.meta.url)));
  const captured = await readScene(bytes, { name: 'skull.spz' });
  const { radius } = boundsOf(captured);
  return { ...(await uploaded(captured)), away: 2.5 * radius };
}

let shared: Promise<Skull> | undefined;

/** Built and uploaded once. */
const skull = (): Promise<Skull> => (shared ??= loadSkull());

/**
 * Limits of each setting: the distance relative to the framing distance, minimum dB, and the maximum ratio of drawn
 * splats to all.
 */
const HELD: readonly (readonly [farther: number, detail: number, decibels: number, share: number])[] = [
  [1, 1, 45, 1.01],
  [1, 2, 32, 0.7],
  [2, 0.4, 45, 1.05],
  [2, 2, 24, 0.25],
];

test('from a distance fewer splats are drawn, and the frame stays the same', async () => {
  const { device, plain, detailed, away } = await skull();
  const renderer = new Renderer(device, serial);
  for (const [farther, detail, decibels, share] of HELD) {
    const camera = viewFrom(farther * away);
    const truth = await readFrame(device, renderer, { gaussians: plain, camera });
    const { visible: all } = await renderer.stats();
    const found = await readFrame(device, renderer, { gaussians: detailed, camera, detail });
    const { visible } = await renderer.stats();
    const covered = truth.filter((_, i) => i % 4 === 3).map((alpha) => (alpha > 0 ? 1 : 0));
    const close = psnr(truth, found, { channels: 4, mask: covered });
    console.log(`${farther} times as far, detail ${detail}: ${close.toFixed(1)} dB with ${visible} of ${all} splats`);
    assert.ok(close >= decibels, `${close} dB`);
    assert.ok(visible <= share * all, `${visible} of ${all}`);
  }
  renderer.destroy();
});

/**
 * Largest change of the image, in dB, while the camera stands still and the error allowed grows by one part in a hundred a frame: the changes of levels in a dolly of that speed, without the other changes.
 */
async function largestPop(detailFade: number): Promise<number> {
  const { device, detailed, away } = await skull();
  const renderer = new Renderer(device, { ...serial, detailFade });
  const camera = viewFrom(3 * away);
  let [last, min]: [Float32Array | undefined, number] = [undefined, Infinity];
  for (let step = 0; step < 5; step++) {
    const image = await readFrame(device, renderer, { gaussians: detailed, camera, detail: 1.6 * 1.01 ** step });
    if (last) min = Math.min(min, psnr(last, image, { channels: 4 }));
    last = image;
  }
  renderer.destroy();
  return min;
}

test('levels fade: at 1 % nearer a frame consecutive frames have a PSNR above 55 dB, and some have less without the fade', async () => {
  const [faded, popping] = [await largestPop(0.5), await largestPop(0)];
  console.log(
    `largest change by levels from frame to frame: ${faded.toFixed(1)} dB; without a fade ${popping.toFixed(1)} dB`,
  );
  assert.ok(faded >= 55, `${faded} dB`);
  assert.ok(popping < faded - 3, `${popping} dB without a fade`);
});

after(endNodeDevice);
