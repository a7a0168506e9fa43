/**
 * S4. Needles, discs, points and giants.
 *
 * Who fails: readers and renderers that invert the covariance: splat-transform #287 (log scale of minus infinity) and #272 (endless loop),
 * aras-p/UnityGaussianSplatting #14 (a degenerate splat fills the screen).
 *
 * Recipe: asked for scales of 0, 1e-30 and 1e-7 to 1e4, aspect ratios of 1e6, discs from their edge. Run so: 1,500 random scenes, and thousands of needles
 * and discs with both rasterizers.
 *
 * Passes: 59 dB or more for any three standard deviations out of 0, 1e-30, 1e-7 to 1e4, aspect ratios of 1e6 and discs seen exactly from
 * their edge. Splats without any extent are left out.
 */
import { test } from 'node:test';
import assert from 'node:assert/strict';
import fc from 'fast-check';
import type { Vector3 } from '@gaussian-splat/core';
import { packGaussians } from '@gaussian-splat/renderer';
import { cloudOf } from '../support/clouds.js';
import { nodeDevice } from '../support/node-device.js';
import type { Quaternion } from '../support/random.js';
import { cameraAt, edgeOnDiscs, needles } from '../support/scenes.js';
import { compare, RASTERIZERS, resized } from './support/pictures.js';
import { holds, sized } from './support/row.js';

const scaleArbitrary = fc.oneof(
  fc.constantFrom(0, 1e-30, 1e-7, 1e-6, 1e-3, 0.1, 1, 10, 1e4),
  fc.double({ min: Math.log(1e-7), max: Math.log(1e4), noNaN: true }).map(Math.exp),
);
const splat = fc
  .record({
    scale: fc.tuple(scaleArbitrary, scaleArbitrary, scaleArbitrary),
    rotation: fc.tuple(...[0, 1, 2, 3].map(() => fc.integer({ min: -9, max: 9 }))),
    position: fc.tuple(...[0, 1, 2].map(() => fc.double({ min: -1, max: 1, noNaN: true }))),
    opacity: fc.double({ min: 0.05, max: 1, noNaN: true }),
  })
  .filter(({ scale, rotation }) => Math.max(...scale) >= 1e-12 && rotation.some((q) => q !== 0));

test('any shape is the shape that the oracle draws', async () => {
  const device = await nodeDevice();
  const camera = cameraAt([0, 0, -4], [0, 0, 0], { width: 64, height: 48 });
  let worst = Infinity;
  await fc.assert(
    fc.asyncProperty(fc.array(splat, { minLength: 1, maxLength: 6 }), async (splats) => {
      const cloud = cloudOf(
        splats.map(({ scale, rotation, position, opacity }, i) => ({
          scale,
          rotation: rotation as unknown as Quaternion,
          position: position as unknown as Vector3,
          opacity,
          color: [0.2 + 0.1 * i, 0.9 - 0.1 * i, 0.5],
        })),
      );
      const { psnr } = await compare(device, cloud, camera);
      worst = Math.min(worst, psnr);
      return psnr >= 59;
    }),
    { numRuns: sized(60, 1500), seed: 4 },
  );
  holds('S4', 'random degenerate shapes, worst', worst, { atLeast: 59, unit: 'dB' });
});

for (const make of [needles, edgeOnDiscs]) {
  test(`${make.name}: thousands at once`, async () => {
    const device = await nodeDevice();
    const { cloud, cameras } = make();
    for (const rasterizer of sized(['quads'] as const, RASTERIZERS)) {
      const { psnr } = await compare(device, cloud, resized(cameras[0], sized(160, 400)), { rasterizer });
      holds('S4', `${make.name}, ${rasterizer}`, psnr, { atLeast: 59, unit: 'dB' });
    }
  });
}

test('splats without extent are left out and counted', () => {
  const points = cloudOf(
    [0, 1e-30, 1e-13].map((scale) => ({ position: [0, 0, 0], scale, opacity: 1, color: [1, 1, 1] })),
  );
  assert.equal(packGaussians(points).droppedCount, 3);
});
