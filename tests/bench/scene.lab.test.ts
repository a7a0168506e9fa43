/** Scenes of the benchmark: copies, camera paths, and the PLY files that other renderers are given. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { eyeOf, validateCamera, type Camera, type GaussianCloud } from '@gaussian-splat/core';
import { readScene } from '@gaussian-splat/formats';
import { packGaussians, type PackedGaussians } from '@gaussian-splat/renderer';
import { room } from '../support/scenes.js';
import { benchModule } from './load.js';

interface Copy {
  readonly offset: readonly [number, number, number];
  readonly length: number;
}

const { placeCopies } = await benchModule('scene/placement.js');
const { tileCloud, packCopies, firstSplats } = await benchModule('scene/tiling.js');
const { camerasAlong, PATH_NAMES } = await benchModule('scene/paths.js');
const { writePly } = await benchModule('peers/ply.js');
const { withDegree } = await benchModule('scene/degree.js');

const small: GaussianCloud = firstSplats(room().cloud, 300);
const SIZE = { width: 320, height: 180 };

test('copies add up to the number of splats that was asked for', () => {
  for (const count of [0, 100, 300, 301, 2999, 3000]) {
    const { copies, radius } = placeCopies({ base: 300, count });
    const total = copies.reduce((sum: number, { length }: Copy) => sum + length, 0);
    assert.equal(total, count || 300);
    assert.ok(radius > 0);
    assert.equal(new Set(copies.map(({ offset }: Copy) => offset.join())).size, copies.length, 'no two in one place');
  }
  assert.throws(() => placeCopies({ base: 1, count: 1, layout: 'pile' }), /layout: expected ground or overhead/);
});

test('what stands overhead is seen from no frame of any path but zoom', () => {
  const { copies, radius } = placeCopies({ base: 300, count: 30_000, layout: 'overhead', visible: 900 });
  const above: Copy[] = copies.filter(({ offset }: Copy) => offset[1] !== 0);
  assert.equal(above.length, 97);
  for (const path of PATH_NAMES.filter((name: string) => name !== 'zoom')) {
    for (const camera of camerasAlong({ path, ...SIZE, frames: 200, radius }) as Camera[]) {
      for (const { offset } of above) assert.ok(!isNearView(camera, offset), `${path} sees a copy at ${offset}`);
    }
  }
});

/** Whether a ball of radius 1 around a point may touch the image. */
function isNearView({ worldToCamera: m, height, fy }: Camera, point: readonly number[]): boolean {
  const [, y, z] = [0, 1, 2].map(
    (r) => m[4 * r] * point[0] + m[4 * r + 1] * point[1] + m[4 * r + 2] * point[2] + m[4 * r + 3],
  );
  const half = Math.atan(height / (2 * fy));
  // Distance to the upper plane of the view: the scene lies below, copies above.
  return -y * Math.cos(half) - z * Math.sin(half) < 1 && z > -1;
}

test('every path gives valid cameras, and strafing does not turn', () => {
  for (const path of PATH_NAMES) {
    const cameras: Camera[] = camerasAlong({ path, ...SIZE, frames: 30, radius: 2.5 });
    assert.equal(cameras.length, 30);
    cameras.forEach((camera) => validateCamera(camera));
  }
  const [first, ...others]: Camera[] = camerasAlong({ path: 'strafe', ...SIZE, frames: 10, radius: 2.5 });
  const rotation = ({ worldToCamera: m }: Camera) => [0, 1, 2, 4, 5, 6, 8, 9, 10].map((i) => m[i].toFixed(12)).join();
  for (const camera of others) assert.equal(rotation(camera), rotation(first));
  const zoom: Camera[] = camerasAlong({ path: 'zoom', ...SIZE, frames: 10, radius: 2.5 });
  const distance = (camera: Camera) => Math.hypot(...eyeOf(camera.worldToCamera));
  assert.ok(Math.abs(distance(zoom[9]) / distance(zoom[0]) - 64) < 1e-9);
  assert.throws(() => camerasAlong({ path: 'walk', ...SIZE, frames: 1, radius: 1 }), /path: expected orbit/);
});

test('packed copies are the packed scene in whole chunks, moved with their bounds', () => {
  const count = 600;
  const large = repeated(small, count);
  const packed: PackedGaussians = packGaussians(large);
  const offsets = [
    [0, 0, 0],
    [2, 0, -2],
  ];
  const copies = [
    { offset: offsets[0], length: count },
    { offset: offsets[1], length: 300 },
  ];
  const tiled: PackedGaussians = packCopies(packed, copies);
  // 600 and 300 splats are two chunks and one.
  assert.equal(tiled.count, 512 + 256);
  const [from, to] = [new Float32Array(packed.geometry.buffer), new Float32Array(tiled.geometry.buffer)];
  for (let i = 0; i < tiled.count; i++) {
    const copy = i < 512 ? 0 : 1;
    const source = i - 512 * copy;
    for (let axis = 0; axis < 3; axis++) {
      assert.ok(Math.abs(to[8 * i + axis] - from[8 * source + axis] - offsets[copy][axis]) < 1e-5, `splat ${i}`);
    }
    assert.deepEqual(tiled.geometry.slice(8 * i + 3, 8 * i + 8), packed.geometry.slice(8 * source + 3, 8 * source + 8));
    // Every splat lies within the bounds of its chunk.
    const chunk = tiled.chunks.subarray(8 * Math.floor(i / 256));
    for (let axis = 0; axis < 3; axis++) {
      assert.ok(to[8 * i + axis] >= chunk[axis] - 1e-5 && to[8 * i + axis] <= chunk[4 + axis] + 1e-5, `bounds of ${i}`);
    }
  }
  const stride = packed.sh.length / packed.count;
  assert.deepEqual(tiled.sh.slice(stride * 512), packed.sh.slice(0, stride * 256));
});

/** The cloud's splats over and over, each time a little farther, up to `count`. */
function repeated(cloud: GaussianCloud, count: number): GaussianCloud {
  const copies = Array.from({ length: Math.ceil(count / cloud.count) }, (_, i) => ({
    offset: [0.37 * i, 0.11 * i, 0.05 * i],
    length: cloud.count,
  }));
  return firstSplats(tileCloud(cloud, copies), count) as GaussianCloud;
}

test('a cloud with fewer bands of color has the first ones', async () => {
  assert.equal(small.shDegree, 3);
  assert.equal(withDegree(small, 3), small);
  for (const degree of [0, 2]) {
    const file = writePly(withDegree(small, degree), [{ offset: [0, 0, 0], length: small.count }]) as Blob;
    const cloud = await readScene(new Uint8Array(await file.arrayBuffer()), { name: 'scene.ply' });
    assert.equal(cloud.shDegree, degree);
    const width = 3 * (degree + 1) ** 2;
    cloud.sh.forEach((value, k) => assert.equal(value, small.sh[48 * Math.floor(k / width) + (k % width)]));
  }
});

test('a PLY for other renderers reads back as the tiled cloud', async () => {
  const { copies } = placeCopies({ base: small.count, count: 700 });
  const expected: GaussianCloud = tileCloud(small, copies);
  const bytes = new Uint8Array(await (writePly(small, copies) as Blob).arrayBuffer());
  const cloud = await readScene(bytes, { name: 'scene.ply' });
  assert.equal(cloud.count, 700);
  assert.equal(cloud.shDegree, small.shDegree);
  for (const name of ['positions', 'rotations', 'scales', 'opacities', 'sh'] as const) {
    for (let i = 0; i < expected[name].length; i++) {
      const limit = 2e-6 * Math.max(1, Math.abs(expected[name][i]));
      assert.ok(Math.abs(cloud[name][i] - expected[name][i]) <= limit, `${name}[${i}]`);
    }
  }
});
