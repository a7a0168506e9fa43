/**
 * S3. The camera inside a splat, and centers at the near plane.
 *
 * Who fails: web-splat, Visionary, PlayCanvas and Spark have no clamp of the Jacobian (read in their sources): 11 dB in a room, by a
 * float64 emulation of the rule; aras-p/UnityGaussianSplatting #14, #147 and #196, INRIA #963 and Resonite #4173 report screen-filling flashes.
 *
 * Recipe: asked for a path through 500 large splats, depths about 0 and the near plane, up to 50 focal lengths aside. Run so: 25 steps with each rasterizer,
 * 1,000 single splats, and times of 25 frames.
 *
 * Passes: 50 dB or more along a path through 500 large splats, with centers beyond 50 focal lengths aside and a hair from the near plane; no NaN;
 * no frame takes more than 3 times the median.
 */
import { test } from 'node:test';
import fc from 'fast-check';
import { GaussianBuffers, packGaussians } from '@gaussian-splat/renderer';
import { cloudOf, repeat } from '../support/clouds.js';
import { nodeDevice } from '../support/node-device.js';
import { seededRandom } from '../support/random.js';
import { cameraAt } from '../support/scenes.js';
import { compareImage, draw, notFinite, RASTERIZERS, truth, THREADS } from './support/images.js';
import { fullTest, holds, sized } from './support/row.js';
import { capture, Renderer } from '../support/renderer.js';

const random = seededRandom(3);
const cloud = cloudOf(
  repeat(500, () => ({
    position: [random.uniform(-2, 2), random.uniform(-2, 2), random.uniform(-2, 2)],
    scale: [random.logUniform(0.05, 3), random.logUniform(0.05, 3), random.logUniform(0.05, 3)],
    rotation: random.rotation(),
    opacity: random.logUniform(0.01, 0.6),
    color: [random.uniform(0, 1), random.uniform(0, 1), random.uniform(0, 1)],
  })),
);
const SIZE = { width: 72, height: 54 };

for (const rasterizer of RASTERIZERS) {
  test(`a path through 500 large splats, ${rasterizer}`, async () => {
    const device = await nodeDevice();
    let [worst, broken] = [Infinity, 0];
    const steps = rasterizer === 'quads' ? sized(5, 25) : sized(2, 25);
    for (let step = 0; step < steps; step++) {
      const t = (step / Math.max(1, steps - 1)) * 2 - 1;
      const camera = cameraAt([3 * t, 0.4 * t, 2.5 * t], [3 * t + 1, 0.2, 2.5 * t + 1], { ...SIZE, fovXDegrees: 90 });
      const pixels = await draw(device, cloud, camera, { rasterizer });
      broken += notFinite(pixels);
      worst = Math.min(worst, compareImage(pixels, truth(cloud, camera)).psnr);
    }
    holds('S3', `${rasterizer}, path through large splats, worst frame`, worst, { atLeast: 59, unit: 'dB' });
    holds('S3', `${rasterizer}, numbers that are not finite`, broken, { atMost: 0, unit: 'numbers' });
  });
}

test('one splat anywhere about the near plane, however far aside', async () => {
  const device = await nodeDevice();
  let worst = Infinity;
  const place = fc.record({
    depth: fc.oneof(
      fc.double({ min: -1e-3, max: 1e-3, noNaN: true }).map((e) => 0.2 + e),
      fc.double({ min: 0.2, max: 3, noNaN: true }),
    ),
    aside: fc.double({ min: -50, max: 50, noNaN: true }),
    above: fc.double({ min: -50, max: 50, noNaN: true }),
    size: fc.double({ min: -6, max: 2, noNaN: true }),
  });
  await fc.assert(
    fc.asyncProperty(place, async ({ depth, aside, above, size }) => {
      const one = cloudOf([
        { position: [aside * depth, above * depth, depth], scale: Math.exp(size), opacity: 0.9, color: [1, 0.6, 0.2] },
      ]);
      // The identity: float32 and float64 agree on the depth, so that the near plane cuts the same splats.
      const camera = {
        ...cameraAt([0, 0, 0], [0, 0, 1], SIZE),
        worldToCamera: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1],
      };
      const { psnr } = compareImage(await draw(device, one, camera), truth(one, camera));
      worst = Math.min(worst, psnr);
      return psnr >= 50;
    }),
    { numRuns: sized(60, 1000), seed: 3 },
  );
  holds('S3', 'one splat about the near plane, up to 50 focal lengths aside, worst', worst, {
    atLeast: 50,
    unit: 'dB',
  });
});

fullTest('no frame of the path takes more than 3 times the median', async () => {
  const device = await nodeDevice();
  const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud));
  const renderer = new Renderer(device, { threads: THREADS });
  const times: number[] = [];
  for (let step = 0; step < 25; step++) {
    const t = step / 12 - 1;
    const camera = cameraAt([3 * t, 0.4 * t, 2.5 * t], [3 * t + 1, 0.2, 2.5 * t + 1], {
      width: 240,
      height: 180,
      fovXDegrees: 90,
    });
    let best = Infinity;
    // The best of three: other programs share the machine.
    for (let round = 0; round < 3; round++) {
      const start = performance.now();
      await capture(device, renderer, { gaussians, camera });
      best = Math.min(best, performance.now() - start);
    }
    times.push(best);
  }
  times.sort((a, b) => a - b);
  holds('S3', 'slowest frame of the path over the median', times[24] / times[12], { atMost: 3, unit: 'times' });
  renderer.destroy();
  gaussians.destroy();
});
