/** The default camera: it frames all of an isolated subject, and the middle of a scene with surroundings. */
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { test } from 'node:test';
import { boundsOf, type Bounds, type Camera, type GaussianCloud, type Vector3 } from '@gaussian-splat/core';
import { resolveContract } from '@gaussian-splat/core/contract';
import { bytesSource, readOnnxHeader } from '@gaussian-splat/core/onnx';
import { readScene } from '@gaussian-splat/formats';
import { someOf } from '../support/extent.js';
import { CameraController } from '../support/element/camera.js';
import { declaredBounds } from '../support/element/parts.js';
import { settings } from '../support/camera-settings.js';
import { needsSharedData, sharedFile } from '../support/data.js';
import { randomSource } from '../support/gpu.js';

const SIZES = [
  [1600, 900],
  [400, 300],
  [390, 844],
];

type Places = Pick<GaussianCloud, 'count' | 'positions' | 'opacities' | 'origin'>;

/**
 * Fractions of opaque centers outside of the default camera's images, the largest of three sizes; and the largest
 * fraction of a side that they cross.
 */
function shown(bounds: Bounds, places: readonly Vector3[]): { outside: number; across: number } {
  const found = SIZES.map(([width, height]) => {
    const controller = new CameraController(settings(), () => undefined);
    controller.setAspect(width / height);
    controller.frame(bounds);
    const camera = controller.view(width, height);
    const pixels = places.map((place) => pixelOf(camera, place));
    const isInside = ([x, y]: number[]): boolean => x >= 0 && x <= width && y >= 0 && y <= height;
    const spans = [0, 1].map((k) => {
      const sorted = pixels.map((pixel) => pixel[k]).sort((a, b) => a - b);
      return sorted.at(-1)! - sorted[0];
    });
    const across = Math.max(spans[0] / width, spans[1] / height);
    return { outside: pixels.filter((pixel) => !isInside(pixel)).length / pixels.length, across };
  });
  return {
    outside: Math.max(...found.map(({ outside }) => outside)),
    across: Math.max(...found.map(({ across }) => across)),
  };
}

function pixelOf({ worldToCamera: m, fx, fy, cx, cy }: Camera, p: Vector3): number[] {
  const [x, y, z] = [0, 4, 8].map((row) => m[row] * p[0] + m[row + 1] * p[1] + m[row + 2] * p[2] + m[row + 3]);
  return z > 0 ? [(fx * x) / z + cx, (fy * y) / z + cy] : [-1, -1];
}

function opaque({ count, positions, opacities, origin }: Places): Vector3[] {
  return Array.from({ length: count }, (_, i) => i)
    .filter((i) => opacities[i] >= 0.1)
    .map((i) => [0, 1, 2].map((axis) => positions[3 * i + axis] + origin[axis]) as unknown as Vector3);
}

/** A standing person: most of her splats are on her trunk. */
function standing(count: number): number[][] {
  const random = randomSource(3);
  return Array.from({ length: count }, (_, i) => {
    const part = i % 10;
    const height = part === 0 ? 0.75 + 0.13 * random() : part < 8 ? 0.1 + 0.6 * random() : -0.85 + 0.95 * random();
    return [0.3 * (random() - 0.5), -height, 0.2 * (random() - 0.5)];
  });
}

const cloudOf = (places: readonly number[][]): Places => ({
  count: places.length,
  positions: Float32Array.from(places.flat()),
  opacities: new Float32Array(places.length).fill(0.8),
  origin: [10, -20, 5],
});

test('a single standing person is shown from head to feet at any aspect ratio, and a few distant specks change nothing', () => {
  const alone = standing(20_000);
  const specks = Array.from({ length: 12 }, (_, i) => [40 + i, 3 * i, -25]);
  for (const places of [alone, [...alone, ...specks]]) {
    const { outside, across } = shown(boundsOf(cloudOf(places)), opaque(cloudOf(alone)));
    assert.ok(outside <= 0.001, `${outside} outside`);
    assert.ok(across > 0.5, `${across} of the frame`);
  }
});

test('with surroundings it is the middle that is framed', () => {
  const random = randomSource(5);
  const far = Array.from({ length: 1_500 }, () => {
    const distance = 2 / (0.02 + random());
    const [azimuth, elevation] = [2 * Math.PI * random(), 0.6 * (random() - 0.5)];
    return [distance * Math.cos(azimuth), distance * elevation, distance * Math.sin(azimuth)];
  });
  const bounds = boundsOf(cloudOf([...standing(20_000), ...far]));
  assert.equal(bounds.subject, undefined);
  assert.ok(bounds.radius < 1.5, `${bounds.radius}`);
});

test('of a single splat, of two, and of many in one place there is something to frame', () => {
  for (const places of [
    [[1, 2, 3]],
    [
      [1, 2, 3],
      [1, 2, 5],
    ],
    Array.from({ length: 300 }, () => [1, 2, 3]),
  ]) {
    const bounds = boundsOf(cloudOf(places));
    const { outside } = shown(bounds, opaque(cloudOf(places)));
    assert.equal(outside, 0);
  }
});

for (const name of someOf(['angel.sog', 'massa.sog', 'st-peter.sog', 'plant.splat', 'angel.compressed.ply'], 2)) {
  test(`${name}: all of it is shown`, { skip: needsSharedData }, async () => {
    const cloud = await readScene(sharedFile(`scenes/${name}`), { name });
    const { outside, across } = shown(boundsOf(cloud), opaque(cloud));
    assert.ok(outside <= 0.0015, `${outside} outside`);
    assert.ok(across > 0.5, `${across} of the frame`);
  });
}

test('skull.ply, as it was trained: the skull, not the room', { skip: needsSharedData }, async () => {
  const cloud = await readScene(sharedFile('scenes/skull.ply'), { name: 'skull.ply' });
  assert.equal(boundsOf(cloud).subject, undefined);
});

test('an avatar is shown from head to feet by the bounds that its contract declares', async () => {
  const file = new URL('../../demo/generators/walker/model.onnx', import.meta.url);
  const header = await readOnnxHeader(bytesSource(new Uint8Array(readFileSync(file))));
  const { contract } = resolveContract({ header });
  const { min, max } = contract!.bounds!;
  const [x, , z] = [0, 1, 2].map((axis) => (min[axis] + max[axis]) / 2);
  const { outside, across } = shown(declaredBounds(contract!)!, [
    [x, min[1], z],
    [x, max[1], z],
  ]);
  assert.equal(outside, 0);
  assert.ok(across > 0.5, `${across} of the frame`);
});
