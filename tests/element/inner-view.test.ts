/** The first view of a captured room is within it, and that of an object is from outside. */
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { createServer } from 'node:http';
import type { AddressInfo } from 'node:net';
import { test } from 'node:test';
import { boundsOf, type Bounds, type GaussianCloud, type Vector3 } from '@gaussian-splat/core';
import { innerViewOf } from '@gaussian-splat/core/views';
import { readScene } from '@gaussian-splat/formats';
import { writeStreamedSog } from '@gaussian-splat/optimize';
import { boundsOfPacked, boundsOfWorld, packCloud } from '@gaussian-splat/renderer/tools';
import { World } from '@gaussian-splat/renderer';
import { encodeWebp } from '../../packages/cli/src/lib/encoders.mjs';
import { openBoxes } from '../support/element/loading.js';
import { CameraController, eyeOfPose, poseOf, viewerFrame, toScene } from '../support/element/camera.js';
import { settings } from '../support/camera-settings.js';
import { needsSharedData, sharedFile } from '../support/data.js';
import { onlyInLab, someOf } from '../support/extent.js';
import { seenAt } from '../support/studio-geometry.js';
import { STUDIO, studio, type StudioScene } from '../support/studio.js';

const ASPECT = 4 / 3;

/** Position of the default camera's eye in scene coordinates. */
function firstEye(bounds: Bounds): Vector3 {
  return toScene(viewerFrame([0, -1, 0]), eyeOfPose(poseOf(settings(), bounds, ASPECT)));
}

/** Whether a held-out view sees a point in front of the surface behind it. */
function isFree(scene: StudioScene, point: Vector3): boolean {
  return scene.held.some((view) => {
    const { depth, x, y } = seenAt(view.camera, point);
    const { width, height, depths } = scene.depths(view);
    const column = Math.floor((x / view.camera.width) * width);
    const row = Math.floor((y / view.camera.height) * height);
    return depth > 0 && column >= 0 && column < width && row >= 0 && depth < depths[column + width * row];
  });
}

/** Whether a point is above a floor. A person's few views show little of the room. */
const isAbove = ({ truth }: StudioScene, [x, height, z]: Vector3): boolean =>
  truth.floors.some(({ x0x1z0z1: [x0, x1, z0, z1], y }) => x > x0 && x < x1 && z > z0 && z < z1 && height < y);

const withInside = (cloud: GaussianCloud): Bounds => {
  const bounds = boundsOf(cloud);
  return { ...bounds, inside: innerViewOf(cloud, bounds) };
};

for (const name of someOf(STUDIO, 1))
  test(`${name}: the camera begins in free space that held-out images show`, async () => {
    const scene = await studio(name);
    const { cloud } = scene;
    const packed = (await packCloud(cloud)).geometry;
    const found = [withInside(cloud), boundsOfPacked(packed, cloud.origin, 8)];
    const onPreview = (preview: GaussianCloud): void => void found.push(withInside(preview));
    await readScene(new Uint8Array(readFileSync(scene.file)), { name: scene.file, onPreview });
    assert.equal(found.length, 3);
    for (const bounds of found) {
      assert.ok(bounds.inside, `${name} has a view from within`);
      const eye = firstEye(bounds);
      assert.ok(isFree(scene, eye) || isAbove(scene, eye), `${eye.join()} is in the scene`);
    }
  });

const OBJECTS = ['plant.splat', 'angel.compressed.ply', 'st-peter.sog', 'massa.sog', 'skull.ply'];
for (const name of someOf(OBJECTS, 2))
  test(`${name} is seen from outside`, { skip: needsSharedData }, async () => {
    const cloud = await readScene(sharedFile(`scenes/${name}`), { name });
    assert.equal(withInside(cloud).inside, undefined);
  });

test('the skull of the site is seen from outside', async () => {
  const file = new URL('../../demo/scenes/skull.spz', import.meta.url);
  assert.equal(
    withInside(await readScene(new Uint8Array(readFileSync(file)), { name: 'skull.spz' })).inside,
    undefined,
  );
});

/** Bounds of a scene that streams as SOG, of which the coarsest level is known. */
async function streamedBounds(cloud: GaussianCloud): Promise<Bounds> {
  const files = await writeStreamedSog(cloud, { steps: STEPS, palette: 64, encodeWebp, effort: 0 });
  const server = createServer(({ url }, response) => {
    response.end(files.get(decodeURIComponent(url!.slice(1))));
  });
  await new Promise<void>((resolve) => server.listen(0, resolve));
  const url = `http://localhost:${(server.address() as AddressInfo).port}/lod-meta.json`;
  const request = { url, credentials: 'omit', sh: 'auto' } as const;
  try {
    return (await openBoxes(request, new AbortController().signal, { onProgress: () => undefined })).levels.scene
      .bounds;
  } finally {
    server.closeAllConnections();
    server.close();
  }
}

const STEPS = { place: 1, size: 0.01, turn: 1, opacity: 1, color: 0.01, harmonics: 0.05 };
for (const name of ['hall', 'apartment'] as const)
  test(`${name} as streamed SOG is seen from within`, { skip: onlyInLab }, async () => {
    const scene = await studio(name);
    const bounds = await streamedBounds(scene.cloud);
    assert.ok(bounds.inside, `${name} has a view from within`);
    assert.ok(isFree(scene, firstEye(bounds)), `${firstEye(bounds).join()} is in the scene`);
  });

test('plant.splat as streamed SOG is seen from outside', { skip: onlyInLab || needsSharedData }, async () => {
  const cloud = await readScene(sharedFile('scenes/plant.splat'), { name: 'plant.splat' });
  assert.equal((await streamedBounds(cloud)).inside, undefined);
});

const ROOM: Bounds = {
  ...{ min: [-5, -3, -5], max: [5, 0, 5], center: [0, -1, 0], radius: 6 },
  inside: { center: [1, -1.5, 2], radius: 0.5, toward: [3, -1.5, 2] },
};

test('the camera stands behind the center of the inner view and looks along it, unless an attribute has a value', () => {
  const near = (found: readonly number[], expected: readonly number[]): void =>
    found.forEach((value, axis) => assert.ok(Math.abs(value - expected[axis]) < 1e-9, `${found} is ${expected}`));
  near(firstEye(ROOM), [0.5, -1.5, 2]);
  const outside: Bounds = { ...ROOM, inside: undefined };
  for (const given of [
    { cameraOrbit: 'auto auto 100%' },
    { cameraOrbit: '10deg auto auto' },
    { cameraTarget: '0m 0m 0m' },
  ])
    assert.deepEqual(poseOf(settings(given), ROOM, ASPECT), poseOf(settings(given), outside, ASPECT));
});

test('an attribute that is set or removed later moves the camera out of the room and back', () => {
  const camera = new CameraController(settings(), () => undefined);
  camera.frame(ROOM);
  const first = camera.goal;
  for (const given of [{ cameraOrbit: 'auto auto 100%' }, { cameraTarget: '0m 0m 0m' }]) {
    camera.applySettings(settings(given));
    const { theta, phi, radius, x, y, z } = poseOf(settings(given), ROOM, 1);
    assert.deepEqual({ ...camera.goal }, { ...first, theta, phi, radius, x, y, z });
    camera.applySettings(settings());
    assert.deepEqual(camera.goal, first);
  }
});

test('another view within the room, after a preview, is a cut: a motion could go through walls', () => {
  const camera = new CameraController(settings(), () => undefined);
  camera.frame({ ...ROOM, inside: undefined });
  camera.refine(ROOM);
  assert.equal(camera.isMoving, false);
  assert.ok(Math.abs(camera.target.x - 1) < 1e-9, `${camera.target.toString()}`);
});

test('a placed room has its view at its place, beside other scenes too; a part that is cut out has none', () => {
  const world = new World();
  const toRight = [1, 0, 0, 10, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
  const box = { min: [-1, -1, -1], max: [1, 0, 1] } as const;
  const placements = [{ bounds: { ...ROOM, inside: undefined } }, { bounds: ROOM, sceneToWorld: toRight }];
  const boundsWith = (crop?: typeof box): Bounds =>
    boundsOfWorld({
      placements: placements.map((placed) => ({ visible: true, ...placed, crop })) as unknown as World['placements'],
    })!;
  assert.deepEqual(boundsWith().inside, { center: [11, -1.5, 2], radius: 0.5, toward: [13, -1.5, 2] });
  assert.equal(boundsWith(box).inside, undefined);
  assert.equal(boundsOfWorld(world), undefined);
});
