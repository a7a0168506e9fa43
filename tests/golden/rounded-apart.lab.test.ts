/**
 * Stages that compute again what another has decided by: compilers may round it differently in each. Every such number of one stage is moved, up and then down,
 * by more than a rounding; nothing may be lost, written over or sorted to the wrong end.
 */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import { GaussianBuffers, packGaussians, type RasterizerName } from '@gaussian-splat/renderer';
import { faultyDevice } from '../stability/support/devices.js';
import { notFinite, turnedAway } from '../stability/support/images.js';
import { cloudOf, repeat } from '../support/clouds.js';
import { psnr } from '../support/metrics.js';
import type { Miscompilation } from '../support/miscompilation.js';
import { asOnSwiftShader, endNodeDevice, serialDevice } from '../support/node-device.js';
import { seededRandom } from '../support/random.js';
import { readFrame } from '../support/read-frame.js';
import { cameraAt } from '../support/scenes.js';
import { Renderer } from '../support/renderer.js';

/** Eight roundings of float32. */
const MOVE = 1e-6;

/** Results of `cull` stay; values computed after it move to one side (1 or -1). */
function movedBy(side: number): readonly Miscompilation[] {
  const factor = (1 + side * MOVE).toFixed(7);
  return [
    {
      shader: /gs\.project/,
      from: 'var e = project_ellipse(view, g);',
      to: `var e = project_ellipse(view, g);
        e.center += vec2f(${side} * 1e-4);
        e.depth *= ${factor};
        e.sigma_x *= ${factor};
        e.sigma_v *= ${factor};
        e.opacity *= ${factor};`,
    },
    // Splats found by the listing of bins, against the painted ones.
    {
      shader: /gs\.bin_count/,
      from: 'opacity / ALPHA_MIN',
      to: `opacity / (${factor} * ALPHA_MIN)`,
    },
    {
      shader: /gs\.rasterize_tiles/,
      from: 'opacity / ALPHA_MIN',
      to: `${factor} * opacity / ALPHA_MIN`,
    },
  ];
}

/** Between the nearest splat and the farthest, which paint much: sorted to the wrong end, either would show. */
const random = seededRandom(21);
const cloud = cloudOf([
  { position: [0, 0, -2.5], scale: 0.3, opacity: 0.8, color: [1, 0.2, 0.1] },
  { position: [0, 0, 3], scale: [3, 3, 0.01], opacity: 0.95, color: [0.1, 0.9, 0.3] },
  ...repeat(1500, () => ({
    position: [random.uniform(-2, 2), random.uniform(-1.5, 1.5), random.uniform(-1.5, 2)] as const,
    scale: [random.logUniform(0.01, 0.2), random.logUniform(0.01, 0.2), random.logUniform(0.01, 0.2)] as const,
    rotation: random.rotation(),
    opacity: random.uniform(0.1, 1),
    color: [random.uniform(0, 1), random.uniform(0, 1), random.uniform(0, 1)] as const,
  })),
]);
const camera = cameraAt([0, 0, -3.5], [0, 0, 0], { width: 160, height: 120 });

/** A view that the camera has just turned to, so that short keys sort it. */
async function drawTurning(device: GPUDevice, rasterizer: RasterizerName): Promise<[Float32Array, number]> {
  const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud));
  const renderer = new Renderer(device, { rasterizer, threads: 'serial' });
  await readFrame(device, renderer, { gaussians, camera: turnedAway(camera) });
  const pixels = await readFrame(device, renderer, { gaussians, camera });
  const { visible } = await renderer.stats();
  renderer.destroy();
  gaussians.destroy();
  return [pixels, visible];
}

for (const rasterizer of ['quads', 'tiles'] as const) {
  test(`${rasterizer}: numbers that another stage decided by may be rounded either way`, async () => {
    const [expected, visible] = await drawTurning(await serialDevice(), rasterizer);
    for (const side of [1, -1]) {
      const { device, befallen } = await faultyDevice(movedBy(side));
      const [pixels, kept] = await drawTurning(await asOnSwiftShader(device), rasterizer);
      device.destroy();
      assert.ok(befallen.includes('gs.project'), befallen.join());
      assert.equal(befallen.length, rasterizer === 'tiles' ? 3 : 1, befallen.join());
      assert.deepEqual([kept, notFinite(pixels)], [visible, 0]);
      const decibels = psnr(pixels, expected, { channels: 4 });
      console.log(`${rasterizer}, moved ${side > 0 ? 'up' : 'down'}: ${decibels.toFixed(1)} dB`);
      assert.ok(decibels >= 70, `${decibels} dB`);
    }
  });
}

after(endNodeDevice);
