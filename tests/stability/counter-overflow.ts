/**
 * S13. Counts beyond 32 bits.
 *
 * Who fails: INRIA's rasterizer keeps the number of pairs in an int (read in its source); 525,000 splats over an image of 8192 x 8192 make more than 4.29 billion
 * pairs of splat and bin. A sum that wraps around looks like room for everything.
 *
 * Recipe: asked for five billion pairs, synthetic. Run with 2.2 million splats that each fill 8192 x 8192 pixels, and with 600 random lists of counts.
 *
 * Passes: sums stop at the largest number for any counts: nothing is written out of bounds, and the overflow is reported.
 */
import { test } from 'node:test';
import assert from 'node:assert/strict';
import fc from 'fast-check';
import { GaussianBuffers, packGaussians } from '@gaussian-splat/renderer';
import { cloudOf, repeat } from '../support/clouds.js';
import { runCase } from '../support/gpu.js';
import { nodeDevice } from '../support/node-device.js';
import { scanOnGpu } from '../support/scan.js';
import { cameraAt } from '../support/scenes.js';
import { deviceWith } from './support/devices.js';
import { THREADS } from './support/images.js';
import { fullTest, holds, sized } from './support/row.js';
import { Renderer } from '../support/renderer.js';

const MAX = 0xffffffff;

/** The twin: exclusive sums that stop at the largest number, and behind them the total. */
function saturatingSums(values: readonly number[]): number[] {
  const sums = [0];
  for (const value of values) sums.push(Math.min(MAX, sums[sums.length - 1] + value));
  return sums;
}

test('prefix sums of any counts stop at the largest number', async () => {
  const device = await nodeDevice();
  let wrong = 0;
  const count = fc.oneof(fc.nat(70_000), fc.constantFrom(0, 1, MAX, 0x80000000, 0x7fffffff, 5_000_000), fc.nat(MAX));
  const counts = fc
    .tuple(fc.array(count, { minLength: 1, maxLength: 40 }), fc.constantFrom(1, 3, 250))
    .map(([values, times]) => Array.from({ length: values.length * times }, (_, i) => values[i % values.length]));
  await fc.assert(
    fc.asyncProperty(counts, async (values) => {
      const found: Uint32Array[] = [];
      await runCase(device, {
        name: 'saturating scan',
        async run(bench) {
          for (const threads of ['parallel', 'serial'] as const) {
            found.push(await scanOnGpu(bench, values, threads));
          }
        },
      });
      const errors = saturatingSums(values).filter((sum, i) => found.some((sums) => sums[i] !== sum)).length;
      wrong += errors;
      return errors === 0;
    }),
    { numRuns: sized(60, 600), seed: 13 },
  );
  holds('S13', 'wrong prefix sums of counts beyond 32 bits', wrong, { atMost: 0, unit: 'sums' });
});

for (const [count, side] of [
  [620_000, 1024],
  [2_200_000, 8192],
]) {
  fullTest(`${count} splats that each fill ${side} x ${side} pixels`, () => countPairs(count, side));
}

async function countPairs(count: number, side: number): Promise<void> {
  const device = await deviceWith([]);
  let isLost = false;
  void device.lost.then(() => (isLost = true));
  // Each fills all bins of the image, of 256 x 128 pixels. The nearest hide the rest.
  const demanded = count * (side / 256) * (side / 128);
  const cloud = cloudOf(
    repeat(count, (i) => ({
      position: [0, 0, (0.62 * i) / count],
      scale: 500,
      opacity: 0.9,
      color: [0.25, 0.5, 0.75],
    })),
  );
  const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud));
  const renderer = new Renderer(device, { threads: THREADS, rasterizer: 'tiles' });
  const target = device.createTexture({ size: [side, side], format: 'rgba8unorm', usage: 0x8 | 0x10 | 0x1 });
  const camera = cameraAt([0, 0, -1], [0, 0, 0], { width: side, height: side });
  renderer.render({ gaussians, camera, target });
  const { pairs, pairOverflow } = await renderer.stats();
  const counted = Math.min(MAX, demanded);
  holds('S13', `pairs that are counted of ${demanded.toPrecision(3)}`, pairs + pairOverflow, {
    atLeast: counted,
    atMost: counted,
    unit: 'pairs',
  });
  const staging = device.createBuffer({ size: 4 * side, usage: 0x1 | 0x8 });
  let wrong = 0;
  for (const y of [0, side / 2, side - 1]) {
    const encoder = device.createCommandEncoder();
    encoder.copyTextureToBuffer({ texture: target, origin: [0, y] }, { buffer: staging, bytesPerRow: 4 * side }, [
      side,
      1,
    ]);
    device.queue.submit([encoder.finish()]);
    await staging.mapAsync(0x1);
    const row = new Uint8Array(staging.getMappedRange());
    wrong += row.filter((value, i) => Math.abs(value - [64, 128, 191, 255][i % 4]) > 1).length;
    staging.unmap();
  }
  holds('S13', 'wrong color values in three rows of the image', wrong, { atMost: 0, unit: 'values' });
  assert.equal(isLost, false, 'the device is there');
  device.destroy();
}
