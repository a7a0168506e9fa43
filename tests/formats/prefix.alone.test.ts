/** Files that are still arriving: the received part is read, and equals the same part of the whole file. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { gzipSync } from 'node:zlib';
import { shCoefficientCount } from '@gaussian-splat/core';
import { encodingsFor } from '@gaussian-splat/optimize';
import { readPrefix, readScene } from '@gaussian-splat/formats';
import { needsSharedData, sharedFile } from '../support/data.js';
import { assertAtMost, assertSameNumbers } from './support/expect.js';
import { writePly } from './support/ply-writer.js';
import { smallCloud } from './support/small-cloud.js';
import { inriaColumns, rawSplats } from './support/splats.js';

const HALF = 0.5;
const FILES: readonly [file: string, share: number, splats: [number, number], degree: number][] = [
  ['formats/playbot3.ply', HALF, [15_400, 15_500], 2],
  ['formats/playbot3.compressed.ply', 0.3, [20_000, 24_000], 0],
  ['formats/playbot3.compressed.ply', 0.9, [31_000, 31_000], 0],
  ['formats/playbot3.c1.sh2.ksplat', HALF, [14_000, 16_000], 2],
  ['scenes/plant.splat', HALF, [7_003, 7_003], 0],
  ['formats/playbot3.niantic-v3.spz', 0.95, [31_000, 31_000], 0],
  ['formats/playbot3.niantic-v4.spz', 0.95, [31_000, 31_000], 0],
];

for (const [name, share, [min, max], degree] of FILES) {
  test(`${name}, the first ${100 * share} %`, { skip: needsSharedData }, async () => {
    const file = sharedFile(name);
    const whole = await readScene(file, { name });
    const part = await readPrefix(file.subarray(0, Math.floor(share * file.length)), { name });
    assert.ok(part, 'there are splats');
    assert.ok(part.count >= min && part.count <= max, `${part.count} splats`);
    assert.equal(part.shDegree, degree);
    assertSameNumbers(part.positions, whole.positions.subarray(0, 3 * part.count), 'positions');
    assertSameNumbers(part.opacities, whole.opacities.subarray(0, part.count), 'opacities');
    const [own, stride] = [3 * shCoefficientCount(part.shDegree), 3 * shCoefficientCount(whole.shDegree)];
    const expected = Array.from(
      { length: own * part.count },
      (_, k) => whole.sh[stride * Math.floor(k / own) + (k % own)],
    );
    assertSameNumbers(part.sh, expected, 'colors');
  });
}

test('the beginning of an SPZ of optimize has the axes that the end of the file declares', async () => {
  const cloud = smallCloud(3000, 3);
  const [encoding] = encodingsFor('a.spz', cloud);
  const file = await encoding.write({ cloud, degrees: new Uint8Array(cloud.count).fill(3) });
  const whole = await readScene(file, { name: 'a.spz' });
  assertAtMost(Math.abs(whole.positions[1] - cloud.positions[1]), 1e-4, 'the height of the first splat');
  const part = await readPrefix(file.subarray(0, Math.floor(0.9 * file.length)), { name: 'a.spz' });
  assert.ok(part, 'there are splats');
  assertSameNumbers(part.positions, whole.positions, 'positions');
  assertSameNumbers(part.rotations, whole.rotations, 'rotations');
});

test(
  'too little to show, and formats that cannot be read in part, give nothing',
  { skip: needsSharedData },
  async () => {
    for (const name of ['formats/playbot3.ply', 'formats/playbot3.niantic-v3.spz', 'formats/playbot3.c0.sh2.ksplat']) {
      assert.equal(await readPrefix(sharedFile(name).subarray(0, 1000), { name }), undefined, name);
    }
    assert.equal(await readPrefix(sharedFile('scenes/massa.sog').subarray(0, 500_000), { name: 'a.sog' }), undefined);
    assert.equal(await readPrefix(new Uint8Array(0)), undefined);
  },
);

test('of a beginning that announces more than it can hold nothing is inflated', async () => {
  const inflated = Buffer.alloc(3e8);
  inflated.write('NGSP', 'latin1');
  // Version 2, 2 ** 32 - 1 splats.
  inflated.writeUInt32LE(2, 4);
  inflated.writeUInt32LE(0xffffffff, 8);
  const file = gzipSync(inflated);
  const before = process.memoryUsage().arrayBuffers;
  let peak = 0;
  const watching = setInterval(() => (peak = Math.max(peak, process.memoryUsage().arrayBuffers - before)), 1);
  assert.equal(await readPrefix(file, { name: 'a.spz' }), undefined);
  clearInterval(watching);
  assertAtMost(peak, 1e8, 'bytes of memory');
});

test('a large scene is previewed before it is whole', { skip: needsSharedData }, async () => {
  const folder = 'scenes/playbot-streamed/1_0/';
  const openFile = async (path: string): Promise<Uint8Array> => sharedFile(folder + path);
  const previews: [count: number, degree: number][] = [];
  const cloud = await readScene(sharedFile(`${folder}meta.json`), {
    name: 'meta.json',
    openFile,
    onPreview: ({ count, shDegree }) => void previews.push([count, shDegree]),
  });
  assert.deepEqual([cloud.count, cloud.shDegree], [250_000, 2]);
  assert.deepEqual(previews, [[15_625, 0]]);
});

test('a number that is still arriving is no number yet', async () => {
  const columns = inriaColumns(rawSplats(3, 0));
  const file = writePly([{ name: 'vertex', columns }], { encoding: 'ascii' });
  assert.equal((await readPrefix(file, { name: 'a.ply' }))?.count, 3);
  for (let missing = 1; missing < 30; missing++) {
    const part = await readPrefix(file.subarray(0, -missing), { name: 'a.ply' });
    assert.equal(part, undefined, `${missing} bytes before the end`);
  }
});
