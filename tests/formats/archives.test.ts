/** Scenes of several files: ZIP archives and streamed SOG. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { strToU8, zipSync } from 'fflate';
import { readScene } from '@gaussian-splat/formats';
import { needsSharedData, sharedFile } from '../support/data.js';
import { assertSameCloud, expectRefusal } from './support/expect.js';
import { writeKsplat } from './support/ksplat-writer.js';
import { smallCloud } from './support/small-cloud.js';
import { writeSog, type SogFiles } from './support/sog-writer.js';

const ksplat = writeKsplat(smallCloud(4, 0), { level: 0 });
const within = (folder: string, files: SogFiles): SogFiles =>
  Object.fromEntries(Object.entries(files).map(([path, bytes]) => [`${folder}/${path}`, bytes]));

test('an archive of one scene is that scene', async () => {
  const direct = await readScene(ksplat, { name: 'a.ksplat' });
  for (const level of [0, 9] as const) {
    const zip = zipSync({ 'readme.txt': strToU8('x'), 'deep/scene.ksplat': ksplat }, { level });
    assertSameCloud(await readScene(zip, { name: 'a.zip' }), direct);
  }
});

test('a bundle within an archive is read, and no deeper', async () => {
  const files = writeSog(smallCloud(40, 1));
  const sog = zipSync(files);
  assertSameCloud(
    await readScene(zipSync({ 'a.sog': sog }), { name: 'a.zip' }),
    await readScene(sog, { name: 'a.sog' }),
  );
  await expectRefusal(zipSync({ 'a.sog': zipSync({ 'b.sog': sog }) }), 'decode/unknown-format', /a\.sog/, {
    name: 'a.zip',
  });
});

test('archives with several scenes, and with sizes that deflate cannot reach, are refused by name', async () => {
  const two = zipSync({ '1.ksplat': ksplat, '2.ksplat': ksplat });
  await expectRefusal(two, 'decode/unsupported', /2 scenes: "1.ksplat", "2.ksplat"/, { name: 'a.zip' });
  const bomb = zipSync({ 'a.ply': strToU8('ply\n') }, { level: 9 });
  const directory = Buffer.from(bomb).indexOf('PK\x01\x02', 0, 'latin1');
  new DataView(bomb.buffer, bomb.byteOffset).setUint32(directory + 24, 0x7fffffff, true);
  await expectRefusal(bomb, 'decode/corrupt', /a size that deflate can reach.*2,147,483,647/, { name: 'a.zip' });
});

const [fine, coarse, sky] = [smallCloud(30, 1, 1), smallCloud(10, 1, 2), smallCloud(3, 0, 3)];
const bound = { min: [-2, -2, -2], max: [2, 2, 2] };
const tree = {
  bound,
  children: [
    { bound, lods: { 0: { file: 0, offset: 0, count: 20 }, 2: { file: 1, offset: 0, count: 6 } } },
    { bound, lods: { 0: { file: 0, offset: 20, count: 10 }, 2: { file: 1, offset: 6, count: 4 } } },
  ],
};
const parts = { ...within('0_0', writeSog(fine)), ...within('2_0', writeSog(coarse)), ...within('env', writeSog(sky)) };
const streamed = (meta: object): Uint8Array => zipSync({ ...parts, 'lod-meta.json': strToU8(JSON.stringify(meta)) });
const filenames = ['0_0/meta.json', '2_0/meta.json'];

test('a streamed scene at each level, in both dialects', async () => {
  const old = { lodLevels: 3, environment: null, filenames, tree };
  const recent = {
    version: 1,
    count: 40,
    counts: [30, 0, 10],
    lodLevels: 3,
    environment: 'env/meta.json',
    filenames,
    tree,
  };
  for (const [level, count] of [
    [0, 30],
    [1, 30],
    [2, 10],
    [9, 10],
  ]) {
    assert.equal((await readScene(streamed(old), { name: 'a.zip', level })).count, count);
    assert.equal((await readScene(streamed(recent), { name: 'a.zip', level })).count, count + 3);
  }
});

test('a streamed scene at all its levels tells which splats show what', async () => {
  const all = { version: 1, lodLevels: 3, environment: 'env/meta.json', filenames, tree };
  const { count, levelRuns } = await readScene(streamed(all), { name: 'a.zip', level: 'all' });
  assert.equal(count, 43);
  assert.deepEqual(levelRuns, [
    { first: 0, count: 20, node: 0, level: 0 },
    { first: 20, count: 10, node: 1, level: 0 },
    { first: 30, count: 6, node: 0, level: 2 },
    { first: 36, count: 4, node: 1, level: 2 },
    { first: 40, count: 3, node: 2, level: 0 },
  ]);
});

test('indices that contradict their files are refused by name', async () => {
  const lods = (run: object): object => ({ lodLevels: 1, filenames, tree: { bound, lods: { 0: run } } });
  const beyond = streamed(lods({ file: 0, offset: 25, count: 6 }));
  await expectRefusal(beyond, 'decode/corrupt', /runs apart within 30 splats, found splats 25 to 31/, {
    name: 'a.zip',
  });
  const twice = { bound, lods: { 0: { file: 0, offset: 0, count: 30 } } };
  const again = streamed({ lodLevels: 1, filenames, tree: { bound, children: new Array(50).fill(twice) } });
  await expectRefusal(again, 'decode/corrupt', /runs apart/, { name: 'a.zip' });
  await expectRefusal(streamed(lods({ file: 7, offset: 0, count: 1 })), 'decode/header', /file/, { name: 'a.zip' });
});

test('the real streamed scene: 7 levels', { skip: needsSharedData }, async () => {
  const folder = 'scenes/playbot-streamed/';
  const openPart = async (path: string): Promise<Uint8Array> => sharedFile(folder + path);
  const counts = [];
  for (const level of [3, 4, 5, 6]) {
    counts.push(
      (await readScene(sharedFile(`${folder}lod-meta.json`), { name: 'lod-meta.json', openPart, level })).count,
    );
  }
  assert.deepEqual(counts, [31_000, 8_406, 3_000, 1_873]);
});
