/**
 * S8. Depth keys whose range is blown up by outliers or by the far plane.
 *
 * Who fails: keys over the bounds of the whole scene: SuperSplat #396 (far splats eat the range), GaussianSplats3D #339; keys of zfar - z as in
 * web-splat, Visionary and WebSplatter: 25 dB with a far plane of 1e6, by a float64 emulation.
 *
 * Recipe: asked for ten splats at 1e5, far planes of 1e6 and infinity, reversed and orthographic projections. Run with the far planes and with 1e10;
 * tests/golden/world.alone.test.ts draws orthographic projections.
 *
 * Passes: 59 dB or more with ten splats 100,000 units away, with far planes of 1e6, 1e10 and infinity, while the camera turns. Depth keys
 * use the distance along the axis, so a reversed projection changes nothing.
 */
import { test } from 'node:test';
import type { GaussianCloud } from '@gaussian-splat/core';
import { cloudOf, repeat } from '../support/clouds.js';
import { nodeDevice } from '../support/node-device.js';
import { psnr } from '../support/metrics.js';
import { toRgba } from '../oracle/oracle.js';
import { seededRandom } from '../support/random.js';
import { cameraAt } from '../support/scenes.js';
import { compareImage, draw, RASTERIZERS, truth } from './support/images.js';
import { chart, holds, note, sized } from './support/row.js';
import { toCamera, worldPosition } from '../oracle/projection.js';
import { renderOracle } from '../oracle/oracle.js';

const random = seededRandom(8);
const near = repeat(3_000, () => ({
  position: [random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-0.3, 0.3)] as const,
  scale: [random.logUniform(0.02, 0.2), random.logUniform(0.02, 0.2), random.logUniform(0.02, 0.2)] as const,
  rotation: random.rotation(),
  opacity: random.uniform(0.2, 0.9),
  color: [random.uniform(0, 1), random.uniform(0, 1), random.uniform(0, 1)] as const,
}));
const outliers = repeat(10, () => ({
  position: [random.uniform(-3e4, 3e4), random.uniform(-3e4, 3e4), 1e5] as const,
  scale: 5e3,
  opacity: 0.9,
  color: [0.2, 0.9, 0.4] as const,
}));
const cloud: GaussianCloud = cloudOf([...near, ...outliers]);
const view = cameraAt([0, 0, -3], [0, 0, 0], { width: sized(96, 240), height: sized(72, 180) });

for (const rasterizer of RASTERIZERS) {
  test(`outliers and far planes, ${rasterizer}`, async () => {
    const device = await nodeDevice();
    for (const far of [1e6, 1e10, Infinity]) {
      const camera = { ...view, far };
      const pixels = await draw(device, cloud, camera, { rasterizer, turning: true });
      const { psnr } = compareImage(pixels, truth(cloud, camera));
      holds('S8', `10 splats at 1e5, far ${far}, turning, ${rasterizer}`, psnr, { atLeast: 59, unit: 'dB' });
    }
  });
}

test('error against bits of the key', async () => {
  const device = await nodeDevice();
  const oracle = truth(cloud, view);
  const ours: [number, number][] = [];
  for (const depthKeyBits of [16, 24, 32] as const) {
    const close = compareImage(await draw(device, cloud, view, { depthKeyBits, turning: true }), oracle).psnr;
    ours.push([depthKeyBits, close]);
    note('S8', `keys of ${depthKeyBits} bits, outliers in view`, close, { unit: 'dB' });
  }
  chart('S8', 'ours: logarithmic, over the visible', ours);
  const depths = Float64Array.from({ length: cloud.count }, (_, i) => toCamera(view, worldPosition(cloud, i))[2]);
  const [min, max] = [Math.min(...depths), Math.max(...depths)];
  const options = { mask: oracle.contributors, channels: 4 };
  const curve = (name: string, key: (z: number, bits: number) => number): void => {
    const points = [10, 12, 14, 16, 20, 24].map((bits) => {
      const image = renderOracle(cloud, view, {
        rules: 'gsplat',
        mode: 'classic',
        depthKeys: depths.map((z) => key(z, bits)),
      });
      return [bits, Math.min(150, psnr(toRgba(image), toRgba(oracle), options))] as const;
    });
    chart('S8', name, points);
    note('S8', `${name}, 16 bits`, points[3][1], { unit: 'dB' });
  };
  curve('linear over all depths', (z, bits) => Math.floor(((z - min) / (max - min)) * (2 ** bits - 1)));
  curve('zfar - z in float32, zfar 1e6', (z, bits) => {
    const words = new Uint32Array(Float32Array.of(1e6 - z).buffer);
    return -(words[0] >>> (32 - Math.min(32, bits + 8)));
  });
});
