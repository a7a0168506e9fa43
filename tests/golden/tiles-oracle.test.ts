/** The compute rasterizer against the oracle. It blends in float32 and stops as the reference does, so it is held tighter. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import { cloudOf, repeat } from '../support/clouds.js';
import { compareWithOracle, describeCloseness } from '../support/compare.js';
import { nodeDevice } from '../support/node-device.js';
import {
  brightColors,
  cameraAt,
  edgeOnDiscs,
  hugeSplats,
  needles,
  offCentre,
  opacityLadder,
} from '../support/scenes.js';

/** Colours around 4 cost more in a float16 target than those around 1. */
const LIMITS = { psnr: 69, p999: 0.5 / 255, max: 1 / 255 };

for (const make of [needles, hugeSplats, opacityLadder, brightColors, edgeOnDiscs, offCentre]) {
  test(`tiles: ${make.name}`, async () => {
    const { name, cloud, cameras } = make();
    for (const [i, camera] of cameras.entries()) {
      const close = await compareWithOracle(await nodeDevice(), cloud, camera, 'classic', { rasterizer: 'tiles' });
      console.log(describeCloseness(`tiles ${name} ${i}`, close));
      assert.ok(close.psnr >= LIMITS.psnr, `${name}: ${close.psnr} dB`);
      assert.ok(close.p999 <= LIMITS.p999, `${name}: 99.9th percentile ${255 * close.p999}/255`);
      assert.ok(close.max <= LIMITS.max, `${name}: worst ${255 * close.max}/255`);
    }
  });
}

test('tiles: with more pairs than there is room for, the farthest are left out and nothing else', async () => {
  // 300 splats over all 255 bins of the image: 76,500 pairs, and room for 65,536. The nearest few hide all others.
  const cloud = cloudOf(
    repeat(300, (i) => ({
      position: [0, 0, 0.01 * i],
      scale: [40, 40, 0.001],
      opacity: 0.9,
      color: [(i % 7) / 7, (i % 5) / 5, (i % 3) / 3],
    })),
  );
  const camera = cameraAt([0, 0, -3], [0, 0, 0], { width: 1920, height: 1080 });
  const close = await compareWithOracle(await nodeDevice(), cloud, camera, 'classic', { rasterizer: 'tiles' });
  console.log(describeCloseness('tiles over capacity', close));
  assert.ok(close.psnr >= LIMITS.psnr && close.max <= LIMITS.max, `${close.psnr} dB, worst ${255 * close.max}/255`);
});

// Dawn keeps Node alive.
after(() => {
  setImmediate(() => process.exit());
});
