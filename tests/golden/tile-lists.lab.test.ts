/** Splats are listed for tiles of two sizes, and four small tiles are rasterized together except in long lists: the image is the same. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import type { Camera } from '@gaussian-splat/core';
import { cloudOf, repeat } from '../support/clouds.js';
import { renderCloud } from '../support/compare.js';
import { anyDevice, endNodeDevice } from '../support/node-device.js';
import { seededRandom } from '../support/random.js';
import { cameraAt } from '../support/scenes.js';

after(endNodeDevice);

/** An image with more bins of small tiles than one pass of the sort has digits. */
const WHOLE = { width: 257, height: 5_441 };
/** Part of it with fewer bins. It begins and ends inside of tiles. */
const PART = { left: 5, top: 2_201, width: 250, height: 1_003 };
/**
 * Largest difference of a channel. Centers of splats are rounded otherwise, so that a pixel may have one splat more or
 * less at its rim, where alpha is 1/255; and the fraction of the pixels that may differ by more than a hundredth of it.
 */
const MAX_DIFFERENCE = 1.1 / 255;
const MAX_FRACTION = 0.01;

test('tiles: large lists, small lists, long lists and squares of tiles give the same pixels', async () => {
  const random = seededRandom(32);
  const splat = (spread: number, size: number) => ({
    position: [
      random.uniform(-0.4, 0.4) * spread,
      random.uniform(-8, 8) * spread,
      random.uniform(-0.05, 0.05),
    ] as const,
    scale: [
      random.logUniform(0.3, 1) * size,
      random.logUniform(0.3, 1) * size,
      random.logUniform(0.3, 1) * size,
    ] as const,
    rotation: random.rotation(),
    opacity: random.uniform(0.05, 0.9),
    color: [random.uniform(0, 1), random.uniform(0, 1), random.uniform(0, 1)] as const,
  });
  // Most splats lie in a few bins near the middle, whose lists are long.
  const cloud = cloudOf([...repeat(500, () => splat(1, 0.2)), ...repeat(2_000, () => splat(0.1, 0.01))]);
  const camera: Camera = { ...cameraAt([0, 0, -4], [0, 0, 0], WHOLE), fx: 1_300, fy: 1_300 };
  const part: Camera = {
    ...camera,
    width: PART.width,
    height: PART.height,
    cx: camera.cx - PART.left,
    cy: camera.cy - PART.top,
  };
  const device = await anyDevice();
  const draw = (view: Camera): Promise<Float32Array> =>
    renderCloud(device, cloud, view, 'classic', { rasterizer: 'tiles' });
  const [whole, cut] = [await draw(camera), await draw(part)];
  let worst = 0;
  let [covered, different] = [0, 0];
  for (let y = 0; y < PART.height; y++) {
    for (let x = 0; x < PART.width; x++) {
      const at = 4 * ((y + PART.top) * WHOLE.width + x + PART.left);
      const own = 4 * (y * PART.width + x);
      if (cut[own + 3]! > 0.1) covered++;
      const difference = Math.max(...[0, 1, 2, 3].map((c) => Math.abs(whole[at + c]! - cut[own + c]!)));
      if (difference > MAX_DIFFERENCE / 100) different++;
      worst = Math.max(worst, difference);
    }
  }
  const pixels = PART.width * PART.height;
  console.log(`${covered} of ${pixels} pixels covered, ${different} different, by ${worst} at most`);
  assert.ok(covered > 0.5 * pixels, `${covered} pixels are covered`);
  assert.ok(different <= MAX_FRACTION * pixels, `${different} pixels differ`);
  assert.ok(worst <= MAX_DIFFERENCE, `a pixel differs by ${worst}`);
});
