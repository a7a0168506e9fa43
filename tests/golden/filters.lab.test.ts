/** Each rule of the low-pass filter, carried by the scene, against the float64 oracle. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import { GaussianBuffers, packGaussians } from '@gaussian-splat/renderer';
import { renderOracle, type Mode } from '../oracle/oracle.js';
import { RULES } from '../oracle/rules.js';
import { closeness } from '../support/compare.js';
import { anyDevice, endNodeDevice } from '../support/node-device.js';
import { proceduralScenes } from '../support/scenes.js';
import { capture, Renderer } from '../support/renderer.js';

after(endNodeDevice);

const FILTERS: readonly [string, Mode, number | undefined][] = [
  ['classic', 'classic', undefined],
  ['antialiased', 'antialiased', undefined],
  ['mip', 'antialiased', 0.1],
];

/** Minimum PSNR of each filter in dB, and an upper limit for the other filters, so that the images distinguish them. */
const [LIMIT_DB, OTHER_DB] = [59, 45];

const { cloud, cameras } = proceduralScenes.find(({ name }) => name === 'pixelSplats')!();
const oracles = FILTERS.map(([, mode, variance = 0.3]) =>
  renderOracle(cloud, cameras[0], { rules: { ...RULES.gsplat, dilation: variance }, mode }),
);

for (const rasterizer of ['quads', 'tiles'] as const) {
  test(`${rasterizer}: each filter is the oracle's own and no other's`, async () => {
    const device = await anyDevice();
    for (const [name, mode, filterVariance] of FILTERS) {
      const packed = packGaussians({ ...cloud, antialiased: mode === 'antialiased', filterVariance });
      const gaussians = await GaussianBuffers.upload(device, packed);
      const renderer = new Renderer(device, { rasterizer });
      const pixels = await capture(device, renderer, { gaussians, camera: cameras[0] });
      renderer.destroy();
      gaussians.destroy();
      for (const [k, [other]] of FILTERS.entries()) {
        const { psnr } = closeness(pixels, oracles[k]);
        if (other === name) assert.ok(psnr >= LIMIT_DB, `${name}: ${psnr} dB`);
        else assert.ok(psnr < OTHER_DB, `${name} against ${other}: ${psnr} dB`);
      }
    }
  });
}
