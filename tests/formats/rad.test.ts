/** RAD, the format of Spark: `npm run lab -- tools` holds it against Spark's own decoder. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { zipSync } from 'fflate';
import { detectFormat, readScene } from '@gaussian-splat/formats';
import type { GaussianCloud } from '@gaussian-splat/core';
import { assertSameCloud, expectRefusal } from './support/expect.js';
import { writeRad, type RadOptions } from './support/rad-writer.js';
import { smallCloud } from './support/small-cloud.js';

const read = (files: Record<string, Uint8Array>, name = 'scene.rad'): Promise<GaussianCloud> =>
  readScene(files[name], { name, openFile: (path) => Promise.resolve(files[path]) });

function assertNear(found: ArrayLike<number>, expected: ArrayLike<number>, tolerance: number, what: string): void {
  assert.equal(found.length, expected.length, what);
  for (let k = 0; k < found.length; k++)
    assert.ok(Math.abs(found[k] - expected[k]) <= tolerance, `${what} ${k}: ${found[k]} for ${expected[k]}`);
}

/** Either sign of a quaternion is right. */
const signed = ({ rotations }: GaussianCloud): Float32Array =>
  rotations.map((value, k) => value * Math.sign(rotations[4 * Math.floor(k / 4)]));

const EXACT: Readonly<Record<string, RadOptions>> = {
  'one chunk': {},
  'chunks of 16 splats': { chunkSize: 16 },
  'chunks beside the file': { chunkSize: 16, isSplit: true },
};

for (const [name, options] of Object.entries(EXACT)) {
  test(`${name}: what was written is read`, async () => {
    const cloud = smallCloud(50, 3);
    const files = writeRad(cloud, { ...options, isExact: true });
    assert.equal(detectFormat(files['scene.rad']), 'rad');
    const found = await read(files);
    assert.equal(found.shDegree, 3);
    assert.deepEqual(found.positions, cloud.positions);
    assert.deepEqual(found.opacities, cloud.opacities);
    assert.deepEqual(found.scales, cloud.scales);
    assertNear(signed(found), signed(cloud), 1e-4, 'rotation');
    assertNear(found.sh, cloud.sh, 1e-6, 'harmonics');
  });
}

test('an archive of a file and of the chunks beside it is that scene', async () => {
  const files = writeRad(smallCloud(50, 1), { chunkSize: 16, isSplit: true, isExact: true });
  const zip = zipSync(Object.fromEntries(Object.entries(files).map(([path, bytes]) => [`a/${path}`, bytes])));
  assertSameCloud(await readScene(zip, { name: 'a.zip' }), await read(files));
});

test('the encodings that Spark chooses are read within their steps', async () => {
  const cloud = smallCloud(50, 2);
  const found = await read(writeRad(cloud, { chunkSize: 32 }));
  assert.deepEqual(found.positions, cloud.positions);
  assertNear(found.opacities, cloud.opacities, 0.5 / 255 + 1e-6, 'opacity');
  assertNear(found.scales.map(Math.log), cloud.scales.map(Math.log), 21 / 254 / 2 + 1e-5, 'logarithm of a scale');
  assertNear(signed(found), signed(cloud), 0.02, 'rotation');
  assertNear(found.sh, cloud.sh, 4 / 127 / 2 + 1e-6, 'harmonics');
});

test('of a tree of levels the leaves are read', async () => {
  const cloud = smallCloud(40, 1);
  const children = Array.from({ length: 40 }, (_, i) => (i < 8 ? 4 : 0));
  const found = await read(writeRad(cloud, { chunkSize: 16, children, isExact: true }));
  assert.equal(found.count, 32);
  assert.deepEqual(found.positions, cloud.positions.slice(24));
  assertNear(found.sh, cloud.sh.slice(12 * 8), 1e-6, 'harmonics');
});

test('harmonics come out of a palette', async () => {
  const cloud = smallCloud(40, 2);
  const found = await read(writeRad(cloud, { chunkSize: 16, palette: 8, isExact: true }));
  const expected = cloud.sh.map((value, k) => {
    const [splat, number] = [Math.floor(k / 27), k % 27];
    return number < 3 ? value : cloud.sh[27 * (splat % 8) + number];
  });
  assertNear(found.sh, expected, 1e-6, 'harmonics');
});

test('a chunk alone is a scene', async () => {
  const cloud = smallCloud(40, 1);
  const files = writeRad(cloud, { chunkSize: 16, isSplit: true, isExact: true });
  const found = await read(files, 'scene-1.radc');
  assert.deepEqual(found.positions, cloud.positions.slice(48, 96));
});

test('what is wrong with a RAD is said', async () => {
  const bytes = writeRad(smallCloud(40, 1), { palette: 4 })['scene.rad'];
  const text = bytes.toString('latin1');
  const changed = (from: string, to: string): Buffer => Buffer.from(text.replace(from, to), 'latin1');
  await expectRefusal(bytes.subarray(0, -100), 'decode/truncated', /chunks\[0\]/, { name: 'a.rad' });
  await expectRefusal(changed('gsplat', 'points'), 'decode/unsupported', /type gsplat/, { name: 'a.rad' });
  await expectRefusal(changed('"r8"', '"q8"'), 'decode/unsupported', /alpha.*known encoding.*q8/, { name: 'a.rad' });
  await expectRefusal(changed('"center"', '"middle"'), 'decode/header', /property center/, { name: 'a.rad' });
  await expectRefusal(changed('"shCodeCount":4', '"shCodeCount":3'), 'decode/corrupt', /deflate stream of \d+ bytes/, {
    name: 'a.rad',
  });
});

test('a chunk in another file is charged for each reference to it', async () => {
  const part = (signature: string, json: object, more: number): Uint8Array => {
    const text = Buffer.from(JSON.stringify(json));
    const bytes = Buffer.alloc(8 + 8 * Math.ceil(text.length / 8) + more);
    bytes.write(signature, 'latin1');
    bytes.writeUInt32LE(text.length, 4);
    text.copy(bytes, 8);
    return new Uint8Array(bytes);
  };
  const chunk = part('RADC', { version: 1, count: 0, properties: [] }, 1 << 20);
  const chunks = Array.from({ length: 500 }, () => ({ filename: 'chunk.radc' }));
  const index = part('RAD0', { version: 1, type: 'gsplat', chunks }, 0);
  const openFile = (): Promise<Uint8Array> => Promise.resolve(chunk);
  await expectRefusal(index, 'out-of-memory/budget', /at most [\d,]+ bytes/, { name: 'a.rad', openFile });
});
