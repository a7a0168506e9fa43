/** A renderer that follows a camera draws the same as a fresh one: no state of an earlier view stays in the order. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import type { Camera } from '@gaussian-splat/core';
import { GaussianBuffers, packGaussians } from '@gaussian-splat/renderer';
import { renderOracle } from '../oracle/oracle.js';
import { cloudOf, repeat } from '../support/clouds.js';
import { closeness, describeCloseness } from '../support/compare.js';
import { endNodeDevice, anyDevice } from '../support/node-device.js';
import { seededRandom } from '../support/random.js';
import { cameraAt, offCenter, resized, room } from '../support/scenes.js';
import { capture, Renderer } from '../support/renderer.js';

/** The camera moved along its own axes (right, down, forward) and then turned to the right by an angle in radians. */
function moved({ worldToCamera: m, ...camera }: Camera, [x, y, z]: readonly number[], angle = 0): Camera {
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  const rows = [0, 1, 2, 3].map((k) =>
    [m[k], m[4 + k], m[8 + k]].map((v, axis) => v - (k === 3 ? [x, y, z][axis] : 0)),
  );
  const turned = rows.map(([a, b, d]) => [c * a - s * d, b, s * a + c * d]);
  return { ...camera, worldToCamera: [0, 1, 2].flatMap((r) => turned.map((v) => v[r])).concat(0, 0, 0, 1) };
}

const steps = [
  [0, 0, 0],
  [0.4, 0, 0],
  [0.4, -0.3, 0.5],
  [-0.6, 0.2, 1.2],
  [0.1, 0.1, -2],
];

for (const make of [room, offCenter]) {
  for (const rasterizer of ['quads', 'tiles'] as const) {
    test(`${make.name}, ${rasterizer}: a camera that moves without turning sees the image of the oracle`, async () => {
      const device = await anyDevice();
      const { cloud, cameras } = make();
      const start = resized(cameras[0], 160);
      const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud));
      const renderer = new Renderer(device, { rasterizer });
      for (const [i, step] of steps.entries()) {
        const camera = moved({ ...start, fx: start.fx * (1 + 0.1 * i), fy: start.fy * (1 + 0.1 * i) }, step);
        const pixels = await capture(device, renderer, { gaussians, camera });
        const close = closeness(pixels, renderOracle(cloud, camera, { rules: 'gsplat', mode: 'classic' }));
        console.log(describeCloseness(`${make.name} ${rasterizer}, moved ${step.join(' ')}`, close));
        assert.ok(close.psnr >= 59, `${close.psnr} dB`);
      }
      renderer.destroy();
      gaussians.destroy();
    });
  }
}

test('several scenes are drawn in their common order while the camera moves', async () => {
  const device = await anyDevice();
  const { cloud, cameras } = room();
  const start = resized(cameras[0], 160);
  const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud));
  const other = offCenter();
  const second = await GaussianBuffers.upload(device, packGaussians(other.cloud));
  const [moving, fresh] = [new Renderer(device), new Renderer(device)];
  const scenes = [gaussians, second];
  await capture(device, moving, { gaussians: scenes, camera: start });
  const camera = moved(start, [0.3, -0.2, 0.6]);
  const expected = await capture(device, fresh, { gaussians: scenes, camera });
  const found = await capture(device, moving, { gaussians: scenes, camera });
  let worst = 0;
  for (let i = 0; i < found.length; i++) worst = Math.max(worst, Math.abs(found[i] - expected[i]));
  assert.ok(worst < 0.01, `worst difference ${worst}`);
  assert.ok((await moving.stats()).visible > 1000);
});

for (const rasterizer of ['quads', 'tiles'] as const) {
  test(`${rasterizer}: a camera that comes near from far away draws what a fresh renderer does`, async () => {
    const device = await anyDevice();
    const random = seededRandom(5);
    const around = (): number => random.uniform(-1, 1);
    const color = (): number => random.uniform(0, 1);
    const splats = repeat(1400, () => ({
      position: [around(), around(), around()],
      scale: 0.1,
      opacity: 0.9,
      color: [color(), color(), color()],
    }));
    const clouds = [cloudOf(splats.slice(0, 700)), cloudOf(splats.slice(700))];
    // The second scene fills the same room, from another origin.
    const positions = clouds[1].positions.map((x, i) => x - (i % 3 === 2 ? 4 : 0));
    const scenes = await Promise.all(
      [clouds[0], { ...clouds[1], origin: [0, 0, 4] as const, positions }].map((cloud) =>
        GaussianBuffers.upload(device, packGaussians(cloud)),
      ),
    );
    const near = cameraAt([0, 0, -4], [0, 0, 0], { width: 96, height: 96 });
    for (const gaussians of [scenes, scenes.slice(1)]) {
      const [coming, fresh] = [new Renderer(device, { rasterizer }), new Renderer(device, { rasterizer })];
      await capture(device, coming, { gaussians, camera: moved(near, [0, 0, -1e6]) });
      const found = await capture(device, coming, { gaussians, camera: near });
      assert.deepEqual(found, await capture(device, fresh, { gaussians, camera: near }));
      const content = gaussians.length > 1 ? cloudOf(splats) : clouds[1];
      const close = closeness(found, renderOracle(content, near, { rules: 'gsplat', mode: 'classic' }));
      assert.ok(close.psnr >= 59, `${close.psnr} dB`);
      for (const renderer of [coming, fresh]) renderer.destroy();
    }
    for (const scene of scenes) scene.destroy();
  });
}

test('the least turn that swaps splats of a plane is drawn', async () => {
  const device = await anyDevice();
  const random = seededRandom(5);
  const splats = repeat(800, () => ({
    position: [random.uniform(-3, 3), random.uniform(-3, 3), 5],
    scale: [0.2, 0.2, 0.001],
    opacity: 0.7,
    color: [random.uniform(0, 1), random.uniform(0, 1), random.uniform(0, 1)],
  }));
  const cloud = cloudOf(splats);
  const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud));
  const faceOn = cameraAt([0, 0, 0], [0, 0, 5], { width: 96, height: 96 });
  const renderer = new Renderer(device, { rasterizer: 'quads' });
  for (const angle of [0, 5e-6]) {
    const camera = moved(faceOn, [0, 0, 0], angle);
    const found = await capture(device, renderer, { gaussians, camera });
    const close = closeness(found, renderOracle(cloud, camera, { rules: 'gsplat', mode: 'classic' }));
    assert.ok(close.psnr >= 59, `turned by ${angle}: ${close.psnr} dB`);
  }
  renderer.destroy();
  gaussians.destroy();
});

after(endNodeDevice);
