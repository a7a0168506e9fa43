/**
 * S2. Equal-depth flicker.
 *
 * Who fails: PlayCanvas (#8570 describes visible flicker), web-splat, Visionary and WebSplatter take slots for visible splats from a global
 * atomicAdd (read in their sources): splats of equal depth then change places from frame to frame.
 *
 * Recipe: asked for a million splats on one plane, 200 identical frames. Run so with both rasterizers, and with turns between; `npm test` has 20,000 splats
 * and 20 frames.
 *
 * Passes: 0 differing bytes in 200 frames of a plane of splats (a million in the full run), also with turns between them.
 */
import { test } from 'node:test';
import { GaussianBuffers, packGaussians } from '@gaussian-splat/renderer';
import { cloudOf, repeat } from '../support/clouds.js';
import { nodeDevice } from '../support/node-device.js';
import { seededRandom } from '../support/random.js';
import { cameraAt } from '../support/scenes.js';
import { differingBytes, RASTERIZERS, yawed, THREADS } from './support/images.js';
import { holds, sized } from './support/row.js';
import { capture, Renderer } from '../support/renderer.js';

const SPLATS = sized(20_000, 1_000_000);
const FRAMES = { quads: sized(20, 200), tiles: sized(4, 200) };

const random = seededRandom(42);
const plane = cloudOf(
  repeat(SPLATS, () => ({
    position: [random.uniform(-3, 3), random.uniform(-2, 2), 0],
    scale: [random.logUniform(0.003, 0.05), random.logUniform(0.003, 0.05), random.logUniform(0.003, 0.05)],
    rotation: random.rotation(),
    opacity: random.uniform(0.1, 1),
    color: [random.uniform(0, 1), random.uniform(0, 1), random.uniform(0, 1)],
  })),
);
const camera = cameraAt([0, 0, -4], [0, 0, 0], { width: 120, height: 80 });

for (const rasterizer of RASTERIZERS) {
  test(`${SPLATS} splats on one plane, ${rasterizer}: every frame has the same bytes`, async () => {
    const device = await nodeDevice();
    const gaussians = await GaussianBuffers.upload(device, packGaussians(plane));
    const renderer = new Renderer(device, { threads: THREADS, rasterizer });
    const first = await capture(device, renderer, { gaussians, camera });
    let differing = 0;
    for (let frame = 1; frame < FRAMES[rasterizer]; frame++) {
      differing += differingBytes(first, await capture(device, renderer, { gaussians, camera }));
    }
    holds('S2', `${rasterizer}, ${FRAMES[rasterizer]} still frames: differing bytes`, differing, {
      atMost: 0,
      unit: 'bytes',
    });
    // A turn and back: the visible are sorted again, by short keys, among which the plane's are all equal.
    const images: Float32Array[] = [];
    for (let turn = 0; turn < sized(2, 4); turn++) {
      await capture(device, renderer, { gaussians, camera: yawed(camera, 0.2 + 0.1 * turn) });
      images.push(await capture(device, renderer, { gaussians, camera }));
    }
    const moved = images.reduce((sum, image) => sum + differingBytes(images[0], image), 0);
    holds('S2', `${rasterizer}, turned away and back: differing bytes`, moved, { atMost: 0, unit: 'bytes' });
    renderer.destroy();
    gaussians.destroy();
  });
}
