/**
 * S18. Images of 0, 1 and 8192 pixels, changes of size, hidden tabs.
 *
 * Who fails: a texture without size is a validation error (gpuweb #4193); cvlab-epfl/gaussian-splatting-web #23 stretches the image after a resize.
 *
 * Recipe: asked for 1,000 changes of size, 0 x 0 among them, densities and hidden tabs. Run so with both rasterizers; 0 x 0, density and tabs in the page
 * (browser/resize.lab.test.ts).
 *
 * Passes: after any sequence of sizes the image is, byte for byte, that of a renderer that never had another size; no validation error. The page's part, with 0 x 0,
 * `display: none` and hidden tabs, is in tests/stability/browser.
 */
import { test } from 'node:test';
import assert from 'node:assert/strict';
import fc from 'fast-check';
import { GaussianBuffers, packGaussians } from '@gaussian-splat/renderer';
import { nodeDevice } from '../support/node-device.js';
import { offCenter } from '../support/scenes.js';
import { compareImage, differingBytes, RASTERIZERS, truth, THREADS } from './support/images.js';
import { holds, sized } from './support/row.js';
import { capture, Renderer } from '../support/renderer.js';

const { cloud, cameras } = offCenter();
const sizedTo = (width: number, height: number) => ({
  ...cameras[0],
  width,
  height,
  cx: width / 2,
  cy: height / 2,
  fx: width,
  fy: width,
});

for (const rasterizer of RASTERIZERS) {
  test(`any sequence of sizes, ${rasterizer}`, async () => {
    const device = await nodeDevice();
    const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud));
    const renderer = new Renderer(device, { threads: THREADS, rasterizer });
    const side = fc.oneof(
      fc.integer({ min: 1, max: 40 }),
      fc.constantFrom(1, 2, 15, 16, 17, 63, 64, 65, 127, 128, 129),
    );
    let differing = 0;
    device.pushErrorScope('validation');
    await fc.assert(
      fc.asyncProperty(side, side, async (width, height) => {
        const camera = sizedTo(width, height);
        const fresh = new Renderer(device, { threads: THREADS, rasterizer });
        const expected = await capture(device, fresh, { gaussians, camera });
        const found = await capture(device, renderer, { gaussians, camera });
        fresh.destroy();
        const count = differingBytes(expected, found);
        differing += count;
        return count === 0;
      }),
      { numRuns: rasterizer === 'quads' ? sized(25, 1000) : sized(8, 1000), seed: 18 },
    );
    assert.equal(await device.popErrorScope(), null);
    holds('S18', `sizes at random, ${rasterizer}: bytes that differ from a fresh start`, differing, {
      atMost: 0,
      unit: 'bytes',
    });
    renderer.destroy();
    gaussians.destroy();
  });

  test(`one pixel high and as wide as textures get, ${rasterizer}`, async () => {
    const device = await nodeDevice();
    const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud));
    const renderer = new Renderer(device, { threads: THREADS, rasterizer });
    for (const [width, height] of [
      [8192, 1],
      [1, 8192],
      [1, 1],
    ]) {
      const camera = sizedTo(width, height);
      const focal = { ...camera, fx: 200, fy: 200 };
      const { psnr } = compareImage(await capture(device, renderer, { gaussians, camera: focal }), truth(cloud, focal));
      holds('S18', `${width} x ${height}, ${rasterizer}`, psnr, { atLeast: 59, unit: 'dB' });
    }
    await assert.rejects(capture(device, renderer, { gaussians, camera: sizedTo(0, 5) }), { code: 'argument/camera' });
    assert.throws(
      () =>
        renderer.render({
          gaussians,
          camera: sizedTo(9000, 5),
          target: device.createTexture({ size: [1, 1], format: 'rgba8unorm', usage: 0x10 }),
        }),
      { code: 'argument/camera' },
    );
    renderer.destroy();
    gaussians.destroy();
  });
}
