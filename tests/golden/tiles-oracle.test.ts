/** The compute rasterizer against the oracle. It blends in float32 and stops as the reference does, so it is held tighter. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import { compareWithOracle, describeCloseness } from '../support/compare.js';
import { nodeDevice } from '../support/node-device.js';
import { brightColors, edgeOnDiscs, hugeSplats, needles, offCentre, opacityLadder } from '../support/scenes.js';

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

// Dawn keeps Node alive.
after(() => {
  setImmediate(() => process.exit());
});
