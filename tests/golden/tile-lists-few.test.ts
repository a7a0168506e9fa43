/** Long lists of tiles are divided into segments, which are blended at the same time: the image is the same. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import type { Camera, GaussianCloud } from '@gaussian-splat/core';
import { GaussianBuffers, packGaussians } from '@gaussian-splat/renderer';
import { AuxiliaryOutputs } from '@gaussian-splat/renderer/tools';
import { FewTiles, fewTilesOn } from '@gaussian-splat/renderer/stages';
import { cloudOf, repeat } from '../support/clouds.js';
import { endNodeDevice, nodeDevice } from '../support/node-device.js';
import { seededRandom } from '../support/random.js';
import { readFrame } from '../support/read-frame.js';
import { cameraAt } from '../support/scenes.js';
import { Renderer } from '../support/renderer.js';

after(endNodeDevice);

/** Largest difference of a channel: one step of the float16 that is stored, for colors below 1. */
const MAX_DIFFERENCE = 0.13 / 255;
/** Minimum number of splats of a segment, so that a small scene has many of them. */
const SEGMENT_SPLATS = 64;

/** Faint splats, so that pixels end in all segments; the nearest and the farthest are seen by some pixels alone. */
function faint(): GaussianCloud {
  const random = seededRandom(32);
  const splat = (spread: number, size: number, opacity: number) => ({
    position: [random.uniform(-1, 1) * spread, random.uniform(-1, 1) * spread, random.uniform(-0.5, 0.5)] as const,
    scale: [
      random.logUniform(0.3, 1) * size,
      random.logUniform(0.3, 1) * size,
      random.logUniform(0.3, 1) * size,
    ] as const,
    rotation: random.rotation(),
    opacity,
    color: [random.uniform(0, 1), random.uniform(0, 1), random.uniform(0, 1)] as const,
  });
  return cloudOf([
    ...repeat(8_000, () => splat(0.1, 0.02, random.logUniform(0.01, 0.4))),
    ...repeat(300, () => splat(1, 0.1, random.uniform(0.1, 0.9))),
  ]);
}

const camera: Camera = { ...cameraAt([0, 0, -4], [0, 0, 0], { width: 96, height: 64 }), fx: 200, fy: 200 };

test('tiles: lists in segments give the pixels of whole lists, in the first frame and with known ends', async () => {
  const device = await nodeDevice();
  const few = fewTilesOn(device);
  few.load = () => undefined;
  const gaussians = await GaussianBuffers.upload(device, packGaussians(faint()));
  const renderer = new Renderer(device, { rasterizer: 'tiles', threads: 'parallel' });
  const draw = (): Promise<Float32Array> => readFrame(device, renderer, { gaussians, camera });
  const whole = await draw();
  few.now = new FewTiles(device, SEGMENT_SPLATS);
  for (const what of ['first', 'second']) {
    const divided = await draw();
    let worst = 0;
    whole.forEach((value, i) => (worst = Math.max(worst, Math.abs(value - divided[i]))));
    console.log(`${what}: ${255 * worst}/255 at most`);
    assert.ok(worst <= MAX_DIFFERENCE, `a pixel differs by ${worst}`);
  }
  renderer.destroy();
  gaussians.destroy();
});
void AuxiliaryOutputs;
