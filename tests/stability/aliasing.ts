/**
 * S21. Aliasing when zooming out.
 *
 * Who fails: the classic dilation makes splats of less than a pixel too large and too bright (Mip-Splatting); every viewer that draws scenes classically shares that,
 * ours too, because such scenes were trained with it. Spark compensates by default, also scenes that were not trained so (33 to 64 dB, by a float64 emulation).
 *
 * Recipe: asked for sizes from 1 to 1/64 against eight times as many pixels; levels of detail no worse. Run so; levels of detail are held to their own
 * figures in tests/detail.
 *
 * Passes: at every zoom, scenes that say they are antialiased are closer to the box-filtered image of 8 times the resolution than drawn classically. Classic figures are
 * reported only.
 */
import { test } from 'node:test';
import type { Camera } from '@gaussian-splat/core';
import { cloudOf, repeat } from '../support/clouds.js';
import { psnr } from '../support/metrics.js';
import { nodeDevice } from '../support/node-device.js';
import { seededRandom } from '../support/random.js';
import { cameraAt } from '../support/scenes.js';
import { draw, resized } from './support/images.js';
import { chart, holds, note, sized } from './support/row.js';

const random = seededRandom(21);
const cloud = cloudOf(
  repeat(3_000, () => {
    const [x, y, z] = random.direction();
    return {
      position: [x, y, z],
      scale: [random.logUniform(0.005, 0.06), random.logUniform(0.005, 0.06), random.logUniform(0.005, 0.06)],
      rotation: random.rotation(),
      opacity: random.uniform(0.3, 1),
      color: [random.uniform(0, 1), random.uniform(0, 1), random.uniform(0, 1)],
    };
  }),
);
const OVERSAMPLING = 8;
const full = cameraAt([0, 0, -3.2], [0, 0, 0], { width: 256, height: 256, fovXDegrees: 45 });

/** Mean of blocks of pixels. */
function boxFiltered(pixels: Float32Array, camera: Camera, block: number): Float32Array {
  const width = camera.width / block;
  const out = new Float32Array(pixels.length / block ** 2);
  for (let i = 0; i < pixels.length; i++) {
    const pixel = i >> 2;
    const [x, y] = [Math.floor((pixel % camera.width) / block), Math.floor(pixel / camera.width / block)];
    out[4 * (y * width + x) + (i & 3)] += pixels[i] / block ** 2;
  }
  return out;
}

test('from full size down to a 64th', async () => {
  const device = await nodeDevice();
  const curves = { classic: [] as [number, number][], antialiased: [] as [number, number][] };
  for (const zoom of sized([4, 32], [1, 2, 4, 8, 16, 32, 64])) {
    const camera = resized(full, 256 / zoom);
    const large = resized(full, (256 / zoom) * OVERSAMPLING);
    const decibels = { classic: 0, antialiased: 0 };
    for (const mode of ['classic', 'antialiased'] as const) {
      const expected = boxFiltered(await draw(device, cloud, large, { mode }), large, OVERSAMPLING);
      decibels[mode] = psnr(await draw(device, cloud, camera, { mode }), expected, { channels: 4 });
      curves[mode].push([zoom, decibels[mode]]);
      note('S21', `1/${zoom} of the size, ${mode}, to its own oversampled image`, decibels[mode], { unit: 'dB' });
    }
    holds('S21', `1/${zoom} of the size: gain of antialiased scenes`, decibels.antialiased - decibels.classic, {
      atLeast: 0,
      unit: 'dB',
    });
  }
  chart('S21', 'classic', curves.classic);
  chart('S21', 'antialiased', curves.antialiased);
});
