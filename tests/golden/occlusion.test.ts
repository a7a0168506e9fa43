/** Splats behind opaque ones are left out while the camera moves: the image must not show it. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import { lookAt, type Camera } from '@gaussian-splat/core';
import { GaussianBuffers, packGaussians, Renderer, type RendererOptions } from '@gaussian-splat/renderer';
import { cloudOf, repeat } from '../support/clouds.js';
import { randomSource } from '../support/gpu.js';
import { psnr } from '../support/metrics.js';
import { isFull } from '../support/extent.js';
import { endNodeDevice, serialDevice } from '../support/node-device.js';
import { readFrame } from '../support/read-frame.js';

const SIZE = { width: 192, height: 128 };

/** An opaque wall with a hole, and coloured splats behind it. */
function wallAndBeyond() {
  const random = randomSource(3);
  const wall = repeat(1500, (i) => {
    const [x, y] = [(i % 50) * 0.08 - 2, Math.floor(i / 50) * 0.08 - 1.2];
    const inHole = Math.hypot(x - 0.7, y) < 0.35;
    const position: [number, number, number] = [x, inHole ? y + 40 : y, 0.02 * (i % 7)];
    return { position, scale: 0.07, opacity: 0.98, color: [0.4, 0.3 + 0.1 * random(), 0.2] };
  });
  const beyond = repeat(1500, () => ({
    position: [6 * (random() - 0.5), 4 * (random() - 0.5), 1 + 3 * random()],
    scale: 0.05,
    opacity: 0.7,
    color: [random(), random(), random()],
  }));
  return cloudOf([...wall, ...beyond] as Parameters<typeof cloudOf>[0]);
}

const cameraAlong = (move: (step: number) => [eye: number[], target: number[]], step: number): Camera => {
  const [eye, target] = move(step) as unknown as [[number, number, number], [number, number, number]];
  const lens = { fx: 190, fy: 190, cx: 96, cy: 64, near: 0.2, far: 1e10 };
  return { ...SIZE, ...lens, worldToCamera: lookAt(eye, target, [0, -1, 0]) };
};

const PATHS = {
  // A degree a frame: 60 degrees a second.
  turning: (step: number) => [
    [0, 0, -3],
    [3 * Math.sin(step * 0.0175), 0, -3 + 3 * Math.cos(step * 0.0175)],
  ],
  strafing: (step: number) => [
    [0.02 * step, 0.01 * step, -3],
    [0.02 * step, 0.01 * step, 0],
  ],
} as unknown as Record<string, (step: number) => [number[], number[]]>;

// As much as keeps the figures that `balanced` and `fast` are held to.
for (const { path, occludedBelow, least } of [
  { path: 'turning', occludedBelow: 0.03, least: 42 },
  { path: 'strafing', occludedBelow: 0.03, least: 42 },
  ...(isFull ? [{ path: 'turning', occludedBelow: 0.1, least: 36 }] : []),
]) {
  const move = PATHS[path];
  test(`${path}, ${occludedBelow}: few splats behind the wall are drawn, and every frame keeps ${least} dB`, async () => {
    const device = await serialDevice();
    const gaussians = await GaussianBuffers.upload(device, packGaussians(wallAndBeyond()));
    let redraws = 0;
    const options: RendererOptions = { rasterizer: 'tiles', occludedBelow, onIncomplete: () => redraws++ };
    const [some, all] = [new Renderer(device, options), new Renderer(device, { rasterizer: 'tiles' })];
    const frames = 5;
    for (let frame = 0; frame <= frames; frame++) {
      // The last frame rests.
      const camera = cameraAlong(move, Math.min(frame, frames - 1));
      const image = await readFrame(device, some, { gaussians, camera });
      const { visible } = await some.readStatistics();
      const expected = await readFrame(device, all, { gaussians, camera });
      const decibels = psnr(image, expected);
      assert.ok(decibels >= (frame === 0 ? 100 : least), `frame ${frame}: ${decibels} dB`);
      if (frame === 0) continue;
      const before = (await all.readStatistics()).visible;
      assert.ok(visible < 0.85 * before, `frame ${frame}: ${visible} of ${before} splats drawn`);
      if (frame === frames && least === 42) assert.ok(decibels >= 55, `at rest: ${decibels} dB`);
      assert.equal(await some.isComplete(), frame === frames, `frame ${frame}`);
    }
    assert.equal(redraws, frames - 1, 'every frame that moved asks for another, one at rest does not');
    [some, all].forEach((renderer) => renderer.destroy());
    gaussians.destroy();
  });
}

test('a jump is drawn whole, and so is a scene whose content changed', async () => {
  const device = await serialDevice();
  const gaussians = await GaussianBuffers.upload(device, packGaussians(wallAndBeyond()));
  const [some, all] = [0.1, 0].map((occludedBelow) => new Renderer(device, { rasterizer: 'tiles', occludedBelow }));
  const front = cameraAlong(PATHS.strafing, 0);
  const behind = cameraAlong(
    () => [
      [0.5, 0, 6],
      [0, 0, 0],
    ],
    0,
  );
  await readFrame(device, some, { gaussians, camera: front });
  const jumped = await readFrame(device, some, { gaussians, camera: behind });
  assert.ok(psnr(jumped, await readFrame(device, all, { gaussians, camera: behind })) >= 100);
  // One scene object, as a generator's: only its version tells that it holds other splats now.
  const changing = { ...scene(gaussians), version: 1 };
  const [here, there] = [0, 1].map((step) => cameraAlong(PATHS.strafing, step));
  for (const camera of [here, there]) await readFrame(device, some, { gaussians: changing, camera });
  assert.equal(await some.isComplete(), false, 'while it moved splats were left out');
  changing.version++;
  await readFrame(device, some, { gaussians: changing, camera: here });
  assert.equal(await some.isComplete(), true);
  const { visible } = await some.readStatistics();
  await readFrame(device, all, { gaussians, camera: here });
  assert.equal(visible, (await all.readStatistics()).visible);
  [some, all].forEach((renderer) => renderer.destroy());
  gaussians.destroy();
});

/** The same content as a scene of its own. */
function scene({ count, shDegree, shPrecision, antialiased, origin, pages }: GaussianBuffers) {
  return { count, shDegree, shPrecision, antialiased, origin, pages };
}

after(endNodeDevice);
