/**
 * Frames that splats cover thousands of times: they are bounded on the GPU before they are drawn, and the next ones have fewer pixels. All others are the same, bit by bit.
 * SECURITY.md: "An oversized scene affects only itself".
 */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import type { Camera, GaussianCloud } from '@gaussian-splat/core';
import { capture, GaussianBuffers, packGaussians, settings, Viewpoint, World } from '@gaussian-splat/renderer';
import { someOf } from '../support/extent.js';
import { cloudOf, repeat } from '../support/clouds.js';
import { anyDevice, endNodeDevice } from '../support/node-device.js';
import { seededRandom } from '../support/random.js';
import { readTexture } from '../support/read-frame.js';
import { cameraAt } from '../support/scenes.js';

after(endNodeDevice);

const camera: Camera = cameraAt([0, 0, -4], [0, 0, 0], { width: 64, height: 48 });
const device = await anyDevice();
const random = seededRandom(46);

const honest = cloudOf(
  repeat(3_000, () => ({
    position: [random.uniform(-1.5, 1.5), random.uniform(-1, 1), random.uniform(-1, 1)] as const,
    scale: [random.logUniform(0.02, 0.5), random.logUniform(0.02, 0.5), random.logUniform(0.02, 0.5)] as const,
    rotation: random.rotation(),
    opacity: random.uniform(0.05, 1),
    color: [random.uniform(0, 1), random.uniform(0, 1), random.uniform(0, 1)] as const,
  })),
);
/** Each over the whole image, as far as the opacity lets it be. */
const bomb = (count: number, opacity: number): GaussianCloud =>
  cloudOf(repeat(count, () => ({ position: [0, 0, 0] as const, scale: 30, opacity, color: [1, 0.5, 0.2] as const })));

async function viewpointOf(
  cloud: GaussianCloud,
  rasterizer: 'quads' | 'tiles',
  limitsOverdraw: boolean,
): Promise<{ viewpoint: Viewpoint; incomplete(): number; end(): void }> {
  let reported = 0;
  const world = new World();
  const scene = await GaussianBuffers.upload(device, packGaussians(cloud));
  world.add({ scene });
  const viewpoint = new Viewpoint(device, world, {
    settings: settings('default', { rasterizer }),
    limitsOverdraw,
    onIncomplete: () => reported++,
  });
  const end = (): void => {
    viewpoint.destroy();
    scene.destroy();
  };
  return { viewpoint, incomplete: () => reported, end };
}

for (const rasterizer of ['quads', 'tiles'] as const) {
  test(`${rasterizer}: a limit changes no frame that keeps it`, async () => {
    const images: Float32Array[] = [];
    for (const limitsOverdraw of [false, true]) {
      const { viewpoint, end } = await viewpointOf(honest, rasterizer, limitsOverdraw);
      images.push(await capture(device, viewpoint, { camera }));
      const { covered } = await viewpoint.stats();
      assert.ok(covered > 50 && covered < 1_000, `covered ${covered} times`);
      assert.equal(viewpoint.pixelShare, 1);
      end();
    }
    assert.deepEqual(images[0], images[1]);
  });

  const bombs = [
    ['faint', 2 / 255],
    ['opaque', 1],
  ] as const;
  for (const [what, opacity] of someOf(bombs, 1)) {
    test(`${rasterizer}: 20,000 ${what} splats, each over the whole image, are drawn with fewer pixels`, async () => {
      const { viewpoint, incomplete, end } = await viewpointOf(bomb(20_000, opacity), rasterizer, true);
      const target = device.createTexture({ size: [camera.width, camera.height], format: 'rgba8unorm', usage: 0x11 });
      viewpoint.draw(camera, { target });
      const first = await readTexture(device, target);
      assert.ok(Math.max(...first) === 0, 'nothing of it is painted before the sum is known');
      assert.ok(!(await viewpoint.isComplete()) || incomplete() > 0, 'the next frame is another one');
      const { covered } = await viewpoint.stats();
      assert.ok(Math.abs(covered / 20_000 - 1) < 0.01, `covered ${covered} times`);
      assert.ok(Math.abs(viewpoint.pixelShare - 1_040 / 20_000 / 1.25) < 1e-3, `share ${viewpoint.pixelShare}`);
      const image = await capture(device, viewpoint, { camera });
      const middle = image.slice(4 * (24 * 64 + 32), 4 * (24 * 64 + 32) + 4);
      assert.ok(middle[0] > 0.9 && middle[3] > 0.99, `the middle of the image: ${[...middle].join(' ')}`);
      // From afar it covers little, and is drawn whole.
      const far = cameraAt([0, 0, -4e4], [0, 0, 0], { width: 64, height: 48 });
      await capture(device, viewpoint, { camera: far });
      assert.equal(viewpoint.pixelShare, 1);
      target.destroy();
      end();
    });
  }
}
