/** Sizes of buffers while scenes, budgets and images change: frames stay complete and valid. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import { capture, GaussianBuffers, packGaussians, settings, Viewpoint, World } from '@gaussian-splat/renderer';
import { packWithDetail } from '@gaussian-splat/renderer/tools';
import { cloudOf, repeat } from '../support/clouds.js';
import { randomSource } from '../support/gpu.js';
import { endNodeDevice, serialDevice } from '../support/node-device.js';
import { cameraAt } from '../support/scenes.js';

after(endNodeDevice);

const camera = cameraAt([0, 0, -6], [0, 0, 0], { width: 96, height: 64 });

/** Balls around the origin. The camera sees them all. */
function balls(count: number, seed: number) {
  const random = randomSource(seed);
  return cloudOf(
    repeat(count, () => ({
      position: [2 * (random() - 0.5), 2 * (random() - 0.5), 2 * (random() - 0.5)],
      scale: 0.01 + 0.05 * random(),
      opacity: 0.2 + 0.8 * random(),
      color: [random(), random(), random()],
    })),
  );
}

test('a scene is hidden after a frame has asked for more pairs and before the next: the next frame is valid', async () => {
  const device = await serialDevice();
  const how = settings('default', { rasterizer: 'tiles' });
  const scenes = await Promise.all(
    [3000, 100].map((count, k) => GaussianBuffers.upload(device, packGaussians(balls(count, k + 1)))),
  );
  const world = new World();
  const [, other] = scenes.map((scene) => world.add({ scene }));
  const viewpoint = new Viewpoint(device, world, { settings: how });
  await capture(device, viewpoint, { camera });
  // The counts of a frame that lacked 15,000 pairs, as a read-back reports them.
  assert.equal(viewpoint.hadRoom(Uint32Array.of(3100, 0, 65_000, 15_000)), false);
  other.visible = false;
  device.pushErrorScope('validation');
  const found = await capture(device, viewpoint, { camera });
  assert.equal(await device.popErrorScope(), null);
  const alone = new World();
  alone.add({ scene: scenes[0] });
  const fresh = new Viewpoint(device, alone, { settings: how });
  assert.deepEqual(found, await capture(device, fresh, { camera }));
  for (const owner of [viewpoint, fresh, ...scenes]) owner.destroy();
});

test('a splat budget takes no splats from scenes without levels of detail', async () => {
  const device = await serialDevice();
  const [leveled, plain] = await Promise.all([
    GaussianBuffers.upload(device, packWithDetail(balls(2000, 3))),
    GaussianBuffers.upload(device, packGaussians(balls(3000, 4))),
  ]);
  for (const rasterizer of ['quads', 'tiles'] as const) {
    const world = new World();
    world.add({ scene: plain });
    world.add({ scene: leveled });
    const viewpoint = new Viewpoint(device, world, {
      settings: settings('default', { rasterizer, splatBudget: 700 }),
    });
    await capture(device, viewpoint, { camera });
    const { visible, overflow } = await viewpoint.stats();
    assert.equal(overflow, 0, `${rasterizer}: ${visible} splats are drawn`);
    assert.ok(visible > 3000 && visible < 5000, `${rasterizer}: ${visible} splats are drawn`);
    viewpoint.destroy();
  }
  for (const scene of [leveled, plain]) scene.destroy();
});

test('an image that is larger than a buffer of the device is read in bands', async () => {
  const device = await serialDevice();
  const scene = await GaussianBuffers.upload(device, packGaussians(balls(500, 5)));
  const world = new World();
  world.add({ scene });
  const viewpoint = new Viewpoint(device, world);
  const odd = { ...camera, width: 33, cx: 16.5 };
  const expected = await capture(device, viewpoint, { camera: odd });
  // A row takes 768 bytes.
  const maxBufferSize = 5 * 768 + 100;
  const small = new Proxy(device, {
    get: (of, name: keyof GPUDevice) => {
      if (name === 'limits') return { maxTextureDimension2D: of.limits.maxTextureDimension2D, maxBufferSize };
      if (name !== 'createBuffer') return typeof of[name] === 'function' ? of[name].bind(of) : of[name];
      return (descriptor: GPUBufferDescriptor) => {
        assert.ok(descriptor.size <= maxBufferSize, `${descriptor.size} bytes`);
        return of.createBuffer(descriptor);
      };
    },
  });
  assert.deepEqual(await capture(small, viewpoint, { camera: odd }), expected);
  viewpoint.destroy();
  scene.destroy();
});

test('settings with another rasterizer during a capture leave its image as it is', async () => {
  const device = await serialDevice();
  const scene = await GaussianBuffers.upload(device, packGaussians(balls(500, 6)));
  const world = new World();
  world.add({ scene });
  const viewpoint = new Viewpoint(device, world, { settings: settings('default', { rasterizer: 'quads' }) });
  const expected = await capture(device, viewpoint, { camera });
  const captured = capture(device, viewpoint, { camera });
  viewpoint.settings = settings('default', { rasterizer: 'tiles' });
  assert.deepEqual(await captured, expected);
  viewpoint.destroy();
  scene.destroy();
});
