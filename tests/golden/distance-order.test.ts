/** `order: 'distance'`: splats nearer to the eye are in front at any depth along the camera's axis, and turning the camera does not change their order. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import type { Vector3 } from '@gaussian-splat/core';
import { capture, GaussianBuffers, packGaussians, settings, Viewpoint, World } from '@gaussian-splat/renderer';
import { cloudOf, type SplatDescription } from '../support/clouds.js';
import { renderCloud } from '../support/compare.js';
import { psnr } from '../support/metrics.js';
import { endNodeDevice, serialDevice } from '../support/node-device.js';
import { cameraAt } from '../support/scenes.js';

const MIN_DB = 59;
after(endNodeDevice);

/** Nearer along the axis of a camera at the origin that looks to +z, but farther away than the other one. */
const aside: SplatDescription = { position: [1.5, 0, 3], scale: 0.9, opacity: 0.9, color: [0.9, 0.1, 0.1] };
const ahead: SplatDescription = { position: [0, 0, 3.2], scale: 0.9, opacity: 0.9, color: [0.1, 0.9, 0.1] };

const draw = async (splats: readonly SplatDescription[], target: Vector3, order: 'center' | 'distance') =>
  renderCloud(
    await serialDevice(),
    cloudOf(splats),
    cameraAt([0, 0, 0], target, { width: 96, height: 64 }),
    'classic',
    {
      order,
    },
  );

/** One image over another, premultiplied. */
const over = (front: Float32Array, back: Float32Array): Float32Array =>
  front.map((value, i) => value + (1 - front[4 * Math.floor(i / 4) + 3]) * back[i]);

for (const target of [
  [0, 0, 3],
  [0.8, 0, 3],
  [-0.5, 0.3, 3],
] as const) {
  test(`looking to ${target.join(' ')}, the splat ahead covers the one aside`, async () => {
    const [one, other] = [await draw([aside], target, 'distance'), await draw([ahead], target, 'distance')];
    const found = await draw([aside, ahead], target, 'distance');
    const decibels = psnr(found, over(other, one), { channels: 4 });
    assert.ok(decibels >= MIN_DB, `${decibels.toFixed(1)} dB`);
    const wrong = psnr(found, over(one, other), { channels: 4 });
    assert.ok(wrong < 40, `${wrong.toFixed(1)} dB the other way around: the splats do not overlap`);
  });
}

test('by center the order of the same splats is another', async () => {
  const target: Vector3 = [0, 0, 3];
  const [byCenter, byDistance] = [
    await draw([aside, ahead], target, 'center'),
    await draw([aside, ahead], target, 'distance'),
  ];
  assert.ok(psnr(byCenter, byDistance, { channels: 4 }) < 40);
});

test('scenes of other scales are ordered by their distance in the world, not by that in their own units', async () => {
  const device = await serialDevice();
  const target: Vector3 = [0.8, 0, 3];
  const camera = cameraAt([0, 0, 0], target, { width: 96, height: 64 });
  const expected = await draw([aside, ahead], target, 'distance');
  const shrunk = (splat: SplatDescription, by: Vector3): SplatDescription => ({
    ...splat,
    position: splat.position.map((x, axis) => x / by[axis]) as unknown as Vector3,
    scale: by.map((factor) => 0.9 / factor) as unknown as Vector3,
  });
  const cases: readonly (readonly (readonly [splats: readonly SplatDescription[], by: Vector3])[])[] = [
    // The scene of the splat ahead has ten units for one of the world.
    [
      [[aside], [1, 1, 1]],
      [[ahead], [0.1, 0.1, 0.1]],
    ],
    // In its own units, the splat aside is nearer than the one ahead.
    [
      [
        [aside, ahead],
        [10, 1, 1],
      ],
    ],
  ];
  for (const scenes of cases) {
    const world = new World();
    const buffers: GaussianBuffers[] = [];
    for (const [splats, by] of scenes) {
      const cloud = cloudOf(splats.map((splat) => shrunk(splat, by)));
      const scene = await GaussianBuffers.upload(device, packGaussians(cloud));
      const [x, y, z] = by;
      world.add({ scene, sceneToWorld: [x, 0, 0, 0, 0, y, 0, 0, 0, 0, z, 0, 0, 0, 0, 1] });
      buffers.push(scene);
    }
    const viewpoint = new Viewpoint(device, world, { settings: settings('default', { order: 'distance' }) });
    const decibels = psnr(await capture(device, viewpoint, { camera }), expected, { channels: 4 });
    assert.ok(decibels >= MIN_DB, `${scenes.length} scenes: ${decibels.toFixed(1)} dB`);
    viewpoint.destroy();
    for (const scene of buffers) scene.destroy();
  }
});
