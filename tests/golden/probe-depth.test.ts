/** Probing the last frame: as opaque as the image itself, at a wall's depth, with either rasterizer. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import type { GaussianCloud } from '@gaussian-splat/core';
import { GaussianBuffers, packGaussians, type RasterizerName } from '@gaussian-splat/renderer';
import { cloudOf, repeat } from '../support/clouds.js';
import { onlyInLab } from '../support/extent.js';
import { randomSource } from '../support/gpu.js';
import { endNodeDevice, serialDevice } from '../support/node-device.js';
import { cameraAt } from '../support/scenes.js';
import { capture, Renderer } from '../support/renderer.js';

/** 1500 balls of all opacities around the origin. */
function randomCloud(): GaussianCloud {
  const random = randomSource(11);
  return cloudOf(
    repeat(1500, () => ({
      position: [4 * (random() - 0.5), 4 * (random() - 0.5), 4 * (random() - 0.5)],
      scale: 0.02 + 0.15 * random(),
      opacity: random(),
      color: [random(), random(), random()],
    })),
  );
}

const RASTERIZERS: readonly RasterizerName[] = ['quads', 'tiles'];

for (const rasterizer of RASTERIZERS) {
  test(`${rasterizer}: the opacity of a point is the alpha of its pixel, in a frame that was sorted and in one that was not`, async () => {
    const device = await serialDevice();
    const cloud = randomCloud();
    const near = cameraAt([0, 0, -6], [0, 0, 0], { width: 96, height: 64 });
    const turned = cameraAt([3, 1, -6], [0, 0, 0], { width: 96, height: 64 });
    const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud));
    const renderer = new Renderer(device, { rasterizer });
    assert.deepEqual(await renderer.probe([{ x: 1, y: 1 }]), [], 'before the first frame there is nothing to probe');
    const random = randomSource(3);
    for (const [i, camera] of [near, turned, turned].entries()) {
      const pixels = await capture(device, renderer, { gaussians, camera });
      const places = Array.from({ length: 64 }, () => ({
        column: Math.floor(camera.width * random()),
        row: Math.floor(camera.height * random()),
      }));
      const answers = await renderer.probe(places.map(({ column, row }) => ({ x: column + 0.5, y: row + 0.5 })));
      for (const [j, { opacity, depth, transmittance }] of answers.entries()) {
        const alpha = pixels[4 * (places[j].row * camera.width + places[j].column) + 3];
        assert.ok(Math.abs(opacity - alpha) < 4e-3, `frame ${i}, point ${j}: opacity ${opacity}, alpha ${alpha}`);
        if (Math.abs(opacity - 0.5) > 1e-4)
          assert.equal(depth === null, opacity < 0.5, `frame ${i}, point ${j}: depth ${depth} at opacity ${opacity}`);
        assert.ok(Math.abs(transmittance - (1 - opacity)) < 1e-5, 'behind everything');
      }
    }
    renderer.destroy();
    gaussians.destroy();
  });
}

test('more points than one row of workgroups has: each gets its own answer', { skip: onlyInLab }, async () => {
  const device = await serialDevice();
  const gaussians = await GaussianBuffers.upload(
    device,
    packGaussians(cloudOf([{ position: [0, 0, 0], scale: 1, opacity: 0.9, color: [1, 1, 1] }])),
  );
  const camera = cameraAt([0, 0, -6], [0, 0, 0], { width: 96, height: 64 });
  const renderer = new Renderer(device, { rasterizer: 'quads' });
  await capture(device, renderer, { gaussians, camera });
  const points = Array.from({ length: 65_535 + 100 }, (_, i) => ({ x: 0.5 + (i % 96), y: 32.5 }));
  const answers = await renderer.probe(points);
  assert.equal(answers.length, points.length);
  for (let i = 96; i < answers.length; i++) assert.deepEqual(answers[i], answers[i % 96], `point ${i}`);
  assert.ok(answers[48].depth !== null && answers[0].depth === null);
  renderer.destroy();
  gaussians.destroy();
});

test('a wall behind a veil: the depth is that of the wall, and only what is behind it is hidden', async () => {
  const device = await serialDevice();
  const sheet = (z: number, opacity: number) =>
    repeat(40 * 40, (i) => ({
      position: [((i % 40) - 20) / 8, (Math.floor(i / 40) - 20) / 8, z] as const,
      scale: [0.08, 0.08, 0.001] as const,
      opacity,
      color: [1, 1, 1] as const,
    }));
  const cloud = cloudOf([...sheet(3, 0.02), ...sheet(5, 0.9)]);
  const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud));
  const renderer = new Renderer(device);
  // Camera at the origin, looking along +z.
  const camera = { ...cameraAt([0, 0, 0], [0, 0, 1]), near: 0.1 };
  await capture(device, renderer, { gaussians, camera });
  const center = { x: camera.width / 2, y: camera.height / 2 };
  const [before, between, behind] = await renderer.probe([2, 4, 6].map((depth) => ({ ...center, depth })));
  assert.ok(behind.depth !== null && Math.abs(behind.depth - 5) < 5 / 1024, `depth ${behind.depth}`);
  assert.equal(before.transmittance, 1);
  assert.ok(between.transmittance > 0.7 && between.transmittance < 1, `veil: ${between.transmittance}`);
  assert.ok(behind.transmittance < 0.05, `wall: ${behind.transmittance}`);
  renderer.destroy();
  gaussians.destroy();
});

for (const unit of [1e-8, 1e-5, 1e5, 1e9]) {
  test(`a wall ${5 * unit} units away is found there, and hides what is behind it alone`, async () => {
    const device = await serialDevice();
    const wall = { position: [0, 0, 5 * unit], scale: [unit, unit, 0], opacity: 0.9, color: [1, 1, 1] } as const;
    const gaussians = await GaussianBuffers.upload(device, packGaussians(cloudOf([wall])));
    const renderer = new Renderer(device);
    const camera = { ...cameraAt([0, 0, 0], [0, 0, 1], { width: 32, height: 32 }), near: 0.1 * unit };
    await capture(device, renderer, { gaussians, camera });
    const depths = [4.9, 5.1].map((depth) => ({ x: 16, y: 16, depth: depth * unit }));
    const [before, behind] = await renderer.probe(depths);
    assert.ok(Math.abs((behind.depth ?? 0) / unit - 5) < 5 / 1024, `depth ${behind.depth}`);
    assert.equal(before.transmittance, 1);
    assert.ok(behind.transmittance < 0.2, `behind it ${behind.transmittance}`);
    renderer.destroy();
    gaussians.destroy();
  });
}

for (const sigma of [0.03, 0.1, 0.3]) {
  test(`a floor of splats of ${100 * sigma} cm is found at its height, not at the depth of the nearest center`, async () => {
    const device = await serialDevice();
    const step = 0.8 * sigma;
    const across = Math.ceil(8 / step);
    const floor = repeat(across * across, (i) => ({
      position: [((i % across) - across / 2) * step, 1.6, 0.5 + Math.floor(i / across) * step] as const,
      scale: [sigma, 0.002, sigma] as const,
      opacity: 0.9,
      color: [1, 1, 1] as const,
    }));
    const gaussians = await GaussianBuffers.upload(device, packGaussians(cloudOf(floor)));
    const renderer = new Renderer(device);
    // The eye is 1.6 m above the floor, which is at y = 1.6: y points down.
    const camera = { ...cameraAt([0, 0, 0], [0, 1.6, 4], { width: 480, height: 360 }), near: 0.1 };
    await capture(device, renderer, { gaussians, camera });
    const points = Array.from({ length: 120 }, (_, i) => ({
      x: 60.5 + 30 * (i % 12),
      y: 169.5 + 15 * Math.floor(i / 12),
    }));
    const [, down, forward] = [0, 1, 2].map((row) => camera.worldToCamera.slice(4 * row, 4 * row + 3));
    const errors = (await renderer.probe(points)).map(({ depth, near, far }, i) => {
      const { x, y } = points[i];
      const right = camera.worldToCamera.slice(0, 3);
      const ray = [0, 1, 2].map(
        (k) => ((x - camera.cx) / camera.fx) * right[k] + ((y - camera.cy) / camera.fy) * down[k] + forward[k],
      );
      assert.ok(depth !== null && near !== null && far !== null, `point ${i} is on the floor`);
      assert.ok(near <= far + 0.05 * far, `${near} to ${far}`);
      return Math.abs(depth - 1.6 / ray[1]) * Math.hypot(...ray);
    });
    errors.sort((a, b) => a - b);
    assert.ok(errors[60] < 0.01 && errors[114] < 0.02, `median ${errors[60]} m, 95 % ${errors[114]} m`);
    // The image is unchanged: the order that the probe needs for a moment is restored.
    const again = await renderer.probe(points.slice(0, 3));
    assert.equal(again.length, 3);
    renderer.destroy();
    gaussians.destroy();
  });
}

after(endNodeDevice);
