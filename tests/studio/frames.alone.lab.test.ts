/** Frames that take less work, on scenes that were trained from images: levels of detail, dynamic quality. docs/accuracy.md has the figures. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import { GaussianBuffers, packGaussians } from '@gaussian-splat/renderer';
import { packWithDetail } from '@gaussian-splat/renderer/tools';
import { addLoss, decibelsOf, levelsForSize, MIN_PSNR, QUALITY_LEVELS } from '../support/element/quality.js';
import { evenly } from '../support/evenly.js';
import { psnr } from '../support/metrics.js';
import { endNodeDevice, serialDevice } from '../support/node-device.js';
import { run } from '../support/pace-gpu.js';
import { readFrame } from '../support/read-frame.js';
import { capture, Renderer } from '../support/renderer.js';
import { resized } from '../support/scenes.js';
import { studio } from '../support/studio.js';

const serial = { threads: 'serial', sort: 'serial' } as const;
/** Scenes in which visitors walk or turn. */
const SCENES = ['apartment', 'garden', 'hall', 'product'] as const;
const decibels = (a: Float32Array, b: Float32Array): number => psnr(a, b, { channels: 4 });
const min = (values: readonly number[]): number => values.reduce((a, b) => Math.min(a, b));

for (const name of SCENES)
  test(`${name}: levels of detail change little of an image, and fade while the camera moves`, async () => {
    const device = await serialDevice();
    const { cloud, held } = await studio(name);
    const [plain, detailed] = await Promise.all([
      GaussianBuffers.upload(device, packGaussians(cloud)),
      GaussianBuffers.upload(device, packWithDetail(cloud)),
    ]);
    const [faded, popping] = [0.5, 0].map((detailFade) => new Renderer(device, { ...serial, detailFade }));
    for (const view of evenly(held, 2)) {
      const camera = resized(view.camera, 200);
      const all = await readFrame(device, faded, { gaussians: plain, camera });
      const { visible } = await faded.stats();
      const exact = await readFrame(device, faded, { gaussians: detailed, camera, detail: 0 });
      assert.deepEqual(exact, all, 'without an allowed error');
      for (const detail of [0.5, 1, 2, 4]) {
        const found = decibels(all, await readFrame(device, faded, { gaussians: detailed, camera, detail }));
        const share = (await faded.stats()).visible / visible;
        console.log(
          `${name} ${view.name}: ${found.toFixed(1)} dB with an allowed error of ${detail} pixels, ${(100 * share).toFixed(0)} % of ${visible} splats`,
        );
        assert.ok(found > 25, `${found} dB`);
      }
      const pops: number[][] = [];
      for (const renderer of [faded, popping]) {
        const images: Float32Array[] = [];
        for (let step = 0; step < 5; step++)
          images.push(await readFrame(device, renderer, { gaussians: detailed, camera, detail: 2 * 1.01 ** step }));
        pops.push(images.slice(1).map((image, k) => decibels(images[k], image)));
      }
      const [soft, hard] = pops.map(min);
      console.log(
        `${name} ${view.name}: consecutive frames, 1 % nearer each: ${soft.toFixed(1)} dB PSNR by the levels alone, ${hard.toFixed(1)} dB without a fade`,
      );
      // A fade begins earlier than a change at once, so it can be alone in changing a frame.
      assert.ok(soft > 50 && soft >= Math.min(hard, 60), `${soft} dB, ${hard} without a fade`);
    }
    [faded, popping, plain, detailed].forEach((owner) => owner.destroy());
  });

/** Times of the full frame of slow GPUs, as multiples of the target. */
const SLOW = [1.2, 1.7, 3, 6];

for (const name of SCENES)
  test(`${name}: a slow GPU draws its motion with less, and no worse than the least that is allowed`, async () => {
    const device = await serialDevice();
    const { cloud, held } = await studio(name);
    const detailed = await GaussianBuffers.upload(device, packWithDetail(cloud));
    const renderer = new Renderer(device, serial);
    const [{ camera }] = held;
    const whole = await capture(device, renderer, { gaussians: detailed, camera });
    const losses = new Map<number, number>();
    const drawn: number[] = [];
    for (const { settings, scale } of QUALITY_LEVELS) {
      const sum = { sum: 0, values: 0 };
      if (scale < 1) {
        addLoss({ values: whole.map((v) => Math.round(255 * v) / 255), ...camera }, scale, 0, 0, sum);
        losses.set(scale, decibelsOf(sum));
      }
      drawn.push(decibels(whole, await capture(device, renderer, { gaussians: detailed, camera, settings })));
    }
    const levels = levelsForSize(camera.width * camera.height, QUALITY_LEVELS, losses);
    const described = QUALITY_LEVELS.map(({ name: level, scale }, k) => {
      const foretold = losses.get(scale);
      return `${level} ${drawn[k].toFixed(1)}${foretold === undefined ? '' : ` (foretold ${foretold.toFixed(1)})`}`;
    });
    console.log(`${name}: PSNR of the levels in dB: ${described.slice(1).join(', ')}`);
    for (const load of SLOW) {
      const costs = levels.map(({ scale }, k) => (k === 0 ? 1 : 0.73 * scale ** 2));
      const gpu = { hertz: 60, load: () => load, fixed: 0.1, shares: () => costs, noise: 0.1, spikes: 0, latency: 2 };
      const { quality } = run({ ...gpu, seed: 1 }, 6_000, levels);
      const moving = drawn[quality.level];
      console.log(`${name}: ${load} times too slow: ${levels[quality.level].name}, ${moving.toFixed(1)} dB`);
      assert.ok(quality.level > 0 && moving > MIN_PSNR - 1.5, `${levels[quality.level].name}: ${moving} dB`);
    }
    [renderer, detailed].forEach((owner) => owner.destroy());
  });

after(endNodeDevice);
