/**
 * S1. Popping on rotation.
 *
 * Who fails: every renderer that sorts by depth along the camera's axis changes order as it turns; those that sort late add the
 * error of an old order: antimatter15's `splat` waits for 8.1 degrees, GaussianSplats3D for 8.1 degrees or a unit, Spark for 2.6 degrees or a
 * millimetre (thresholds read in their sources), PlayCanvas on WebGL for its worker.
 *
 * Recipe: asked for one fixed view with orders of other directions, and a pure roll; an order for each pixel 20 dB better at 1 degree. Run so, with eleven
 * angles from 0.1 to 30 degrees and 40 frames of a turn; there is no order for each pixel, so that part is not met.
 *
 * Passes: the error of an order that is d degrees old, in one fixed view, is the float64 oracle's own within 1 % of its dB; a roll reorders
 * nothing; while the camera turns the picture is that of the exact order.
 */
import { test } from 'node:test';
import assert from 'node:assert/strict';
import type { Camera, GaussianCloud } from '@gaussian-splat/core';
import { capture, GaussianBuffers, packGaussians, Renderer } from '@gaussian-splat/renderer';
import { renderOracle, toRgba } from '../oracle/oracle.js';
import { toCamera, worldPosition } from '../oracle/projection.js';
import { closeness } from '../support/compare.js';
import { psnr } from '../support/metrics.js';
import { nodeDevice } from '../support/node-device.js';
import { notePasses } from '../support/passes.js';
import { room } from '../support/scenes.js';
import { fullDevice } from './support/devices.js';
import { resized, rolled, yawed, THREADS } from './support/pictures.js';
import { chart, holds, note, sized } from './support/row.js';

const scene = room();
const cloud = scene.cloud;
const view = resized(scene.cameras[0], sized(120, 320));
const ANGLES = sized([0.5, 2.6, 8.1], [0.1, 0.2, 0.5, 1, 2, 2.6, 5, 8.1, 10, 20, 30]);
const radians = (degrees: number): number => (degrees * Math.PI) / 180;

const keysOf = (cloud: GaussianCloud, camera: Camera): Float32Array =>
  Float32Array.from({ length: cloud.count }, (_, i) => toCamera(camera, worldPosition(cloud, i))[2]);

test('an old order costs what it costs the oracle', async () => {
  // In float32: rounding of the blend target would hide what a small turn costs.
  const device = await fullDevice();
  const precise = { threads: THREADS, rasterizer: 'quads', accumulation: 'rgba32float' } as const;
  const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud, { sh: 'float16' }));
  const exact = new Renderer(device, precise);
  const fresh = await capture(device, exact, { gaussians, camera: view });
  const truth = renderOracle(cloud, view, { rules: 'gsplat', mode: 'classic' });
  const curves: { ours: [number, number][]; oracle: [number, number][] } = { ours: [], oracle: [] };
  for (const degrees of ANGLES) {
    const old = yawed(view, radians(degrees));
    // A renderer that may turn half a circle before it sorts keeps the order of its first frame.
    const lazy = new Renderer(device, { ...precise, sortAngle: Math.PI });
    await capture(device, lazy, { gaussians, camera: old });
    const late = await capture(device, lazy, { gaussians, camera: view });
    const oracle = renderOracle(cloud, view, { rules: 'gsplat', mode: 'classic', depthKeys: keysOf(cloud, old) });
    const options = { mask: truth.contributors, channels: 4 };
    const ours = psnr(late, fresh, options);
    const own = psnr(toRgba(oracle), toRgba(truth), options);
    curves.ours.push([degrees, ours]);
    curves.oracle.push([degrees, own]);
    note('S1', `order ${degrees} degrees old: ours`, ours, { unit: 'dB' });
    holds('S1', `order ${degrees} degrees old: ours above the oracle's own`, (ours - own) / own, {
      atLeast: -0.01,
      unit: 'of its dB',
    });
    lazy.destroy();
  }
  chart('S1', 'an old order, oracle', curves.oracle);
  chart('S1', 'an old order, ours', curves.ours);
  exact.destroy();
  gaussians.destroy();
});

test('a turning camera always has the order of its own direction; a roll sorts nothing', async () => {
  const device = await nodeDevice();
  const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud, { sh: 'float16' }));
  const renderer = new Renderer(device, { threads: THREADS });
  let worst = Infinity;
  for (let step = 0; step < sized(4, 40); step++) {
    const camera = yawed(view, radians(1.7 * step));
    const pixels = await capture(device, renderer, { gaussians, camera });
    const oracle = renderOracle(cloud, camera, { rules: 'gsplat', mode: 'classic' });
    worst = Math.min(worst, closeness(pixels, oracle).psnr);
  }
  holds('S1', 'turning at 1.7 degrees a frame, worst frame', worst, { atLeast: 59, unit: 'dB' });
  const still = yawed(view, 0.3);
  await capture(device, renderer, { gaussians, camera: still });
  await capture(device, renderer, { gaussians, camera: still });
  for (const angle of [0.1, 1, 3]) {
    const passes = notePasses(device);
    const camera = rolled(still, angle);
    const pixels = await capture(device, renderer, { gaussians, camera });
    passes.stop();
    assert.deepEqual(
      passes.labels.filter((label) => /sort|order/.test(label)),
      [],
      'sorting passes of a roll',
    );
    const oracle = renderOracle(cloud, camera, { rules: 'gsplat', mode: 'classic' });
    holds('S1', `rolled by ${angle} rad without a sort`, closeness(pixels, oracle).psnr, { atLeast: 59, unit: 'dB' });
  }
  renderer.destroy();
  gaussians.destroy();
});
