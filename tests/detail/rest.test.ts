/** A streamed view at rest says how many pages, splats and bytes it rests at, and what keeps more away. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import { multiply, type Matrix4 } from '@gaussian-splat/core';
import { settings, StreamedGaussians, Viewpoint, World, type StreamOptions } from '@gaussian-splat/renderer';
import { detailFolder } from '../support/detail-folder.js';
import { drawUntilCalm } from '../support/draw-until-calm.js';
import { anyDevice, endNodeDevice } from '../support/node-device.js';
import { Renderer } from '../support/renderer.js';
import { cameraAt } from '../support/scenes.js';
import { pebbles } from '../support/scenes/pebbles.js';

after(endNodeDevice);

const folder = detailFolder(pebbles(6_000));
const camera = cameraAt([3, -1, 3], [0, 0, 0], { width: 48, height: 32, fovXDegrees: 60, near: 0.01 });

/** Progress of the scene when nothing more comes. */
async function rest(options: Partial<StreamOptions> = {}, detail = 0.02): Promise<StreamedGaussians['progress']> {
  const device = await anyDevice();
  const scene = await StreamedGaussians.open(device, folder.manifest, {
    ...{ fetchPage: folder.fetchPage, arrivalMs: 0 },
    ...options,
  });
  const renderer = new Renderer(device, { threads: 'serial' });
  try {
    await drawUntilCalm(scene, renderer, camera, detail);
    return scene.progress;
  } finally {
    [renderer, scene].forEach((owner) => owner.destroy());
  }
}

test('the file is the limit, then the memory, then the network', async () => {
  const whole = await rest();
  assert.deepEqual([whole.resident, whole.limit, whole.error], [whole.total, null, 0]);
  assert.deepEqual(whole.reasons, []);
  assert.ok(whole.splats >= 6_000, 'levels and all of the splats');

  const coarse = await rest({}, 60);
  assert.ok(coarse.resident < whole.total && coarse.bytes < whole.bytes);
  assert.deepEqual([coarse.limit, coarse.reasons], [null, []], 'the view needs no more');

  const half = await rest({ memoryBudget: whole.bytes / 2 });
  assert.equal(half.limit, 'memory');
  assert.ok(half.error > 0.02 && half.coming === 0, JSON.stringify(half));
  assert.ok(half.bytes <= whole.bytes / 2 && half.splats < whole.splats && half.splats > 0);
  const megabytes = (half.bytes / 1e6).toFixed(1);
  assert.match(half.reasons.join(), new RegExp(`^${half.resident} of ${whole.total} pages .*${megabytes} MB, is full`));

  const lost = await rest({
    fetchPage: async (file) => {
      if (!file.includes('00000')) throw new Error('404');
      return folder.fetchPage(file);
    },
  });
  assert.deepEqual([lost.limit, lost.coming], ['failure', 0]);
  assert.match(lost.reasons.join(), /could not be loaded/);
});

const move = (x: number, y: number, z: number): Matrix4 => [1, 0, 0, x, 0, 1, 0, y, 0, 0, 1, z, 0, 0, 0, 1];
const stretch = (by: number): Matrix4 => [by, 0, 0, 0, 0, by, 0, 0, 0, 0, by, 0, 0, 0, 0, 1];
const far = cameraAt([60, -2, 0], [0, 0, 0], { width: 48, height: 32, fovXDegrees: 60, near: 0.01 });

/** A placed scene in a world that is drawn only when the scene asks for a frame, as a page draws it. */
async function placed(sceneToWorld: Matrix4) {
  const device = await anyDevice();
  let isDue = true;
  const scene = await StreamedGaussians.open(device, folder.manifest, {
    ...{ fetchPage: folder.fetchPage, arrivalMs: 0 },
    onChange: () => (isDue = true),
  });
  const world = new World();
  const placement = world.add({ scene, sceneToWorld });
  const viewpoint = new Viewpoint(device, world, { settings: settings('default', { threads: 'serial', detail: 0.2 }) });
  const target = device.createTexture({ size: [far.width, far.height], format: 'rgba8unorm', usage: 0x10 });
  /** Draws until no frame was asked for in 300 ms. @returns the pages that are resident then */
  const settle = async (view = far): Promise<number[]> => {
    isDue = true;
    for (let idle = 0; idle < 300; idle += isDue ? -idle : 10) {
      if (isDue) {
        isDue = false;
        viewpoint.draw(view, { target });
      }
      await device.queue.onSubmittedWorkDone();
      await new Promise((resolve) => setTimeout(resolve, 10));
    }
    return scene.pagesInSlots.filter((page) => page !== undefined).sort((a, b) => a - b);
  };
  const free = (): void => [viewpoint, scene, target].forEach((owner) => owner.destroy());
  return { placement, settle, free };
}

test('pages of a placed scene are those of a camera that sees the scene as the same', async () => {
  const still = await placed(move(0, 0, 0));
  const expected = await still.settle();
  // The same view of a scene that is elsewhere, or smaller. In its own coordinates, the camera would be near it.
  const moved = await placed(move(-55, 0, 0));
  assert.deepEqual(
    await moved.settle({ ...far, worldToCamera: multiply(far.worldToCamera, move(55, 0, 0)) }),
    expected,
  );
  const small = await placed(stretch(0.05));
  const { worldToCamera } = far;
  const nearer = multiply(multiply(stretch(0.05), worldToCamera), stretch(20));
  assert.deepEqual(await small.settle({ ...far, worldToCamera: nearer, near: far.near * 0.05 }), expected);
  for (const each of [still, moved, small]) each.free();
});

test('a scene that is moved once to the front of a camera at rest gets the pages that it needs there', async () => {
  const one = await placed(move(0, 0, 0));
  const before = await one.settle();
  one.placement.sceneToWorld = move(55, 0, 0);
  const found = await one.settle();
  const near = await placed(move(55, 0, 0));
  const expected = await near.settle();
  assert.ok(expected.length > before.length, 'the near scene needs more pages');
  assert.deepEqual(found, expected);
  for (const each of [one, near]) each.free();
});

test('all views that are drawn in one task show the same pages and fades', async () => {
  const device = await anyDevice();
  const scene = await StreamedGaussians.open(device, folder.manifest, { fetchPage: folder.fetchPage });
  const world = new World();
  world.add({ scene });
  const viewpoint = new Viewpoint(device, world, {
    settings: settings('default', { threads: 'serial', detail: 0.02 }),
  });
  const target = device.createTexture({ size: [camera.width, camera.height], format: 'rgba8unorm', usage: 0x10 });
  const versions = new Set<number>();
  while (scene.progress.limit !== null || versions.size < 3) {
    viewpoint.draw(camera, { target });
    const { version } = scene;
    versions.add(version);
    viewpoint.draw(camera, { target });
    assert.equal(scene.version, version);
    await device.queue.onSubmittedWorkDone();
    await new Promise((resolve) => setTimeout(resolve, 5));
  }
  [viewpoint, scene, target].forEach((owner) => owner.destroy());
});
