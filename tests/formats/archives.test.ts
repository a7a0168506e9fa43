/** Scenes of several files: ZIP archives and streamed SOG. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { deflateSync, strToU8, zipSync } from 'fflate';
import { encodingsFor } from '@gaussian-splat/optimize';
import { readScene } from '@gaussian-splat/formats';
import { crc32 } from '../../packages/formats/src/zip/crc32.js';
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
  await expectRefusal(
    zipSync({ 'a.sog': zipSync({ 'b.sog': sog }) }),
    'decode/unknown-format',
    /a\.sog.*an archive within an archive within an archive/,
    {
      name: 'a.zip',
    },
  );
});

test('archives with several scenes, and with sizes that deflate cannot reach, are refused by name', async () => {
  const two = zipSync({ '1.ksplat': ksplat, '2.ksplat': ksplat });
  await expectRefusal(two, 'decode/unsupported', /2 scenes: "1.ksplat", "2.ksplat"/, { name: 'a.zip' });
  const bomb = zipSync({ 'a.ply': strToU8('ply\n') }, { level: 9 });
  const directory = Buffer.from(bomb).indexOf('PK\x01\x02', 0, 'latin1');
  new DataView(bomb.buffer, bomb.byteOffset).setUint32(directory + 24, 0x7fffffff, true);
  await expectRefusal(bomb, 'decode/corrupt', /a size that deflate can reach.*2,147,483,647/, { name: 'a.zip' });
  // Nor out of bytes that the file does not have.
  new DataView(bomb.buffer, bomb.byteOffset).setUint32(directory + 20, 0x7fffffff, true);
  await expectRefusal(bomb, 'decode/corrupt', /a size that deflate can reach.*2,147,483,647/, { name: 'a.zip' });
});

test('inflating ends where the directory of an archive says that a file ends', async () => {
  const content = Buffer.concat([ksplat, Buffer.alloc(1 << 25)]);
  const zip = zipSync({ 'a.ksplat': content }, { level: 9 });
  const directory = Buffer.from(zip).indexOf('PK\x01\x02', 0, 'latin1');
  const view = new DataView(zip.buffer, zip.byteOffset);
  view.setUint32(directory + 16, crc32(ksplat), true);
  view.setUint32(directory + 24, ksplat.length, true);
  // The data after the first 20 KB, which inflate to many megabytes, are damaged.
  zip.fill(0xff, 20_000, directory);
  await expectRefusal(zip, 'decode/corrupt', /an intact deflate stream, found more than \d+ bytes/, { name: 'a.zip' });
});

test('of what a training wrote the splats after most iterations are read, not the points that it began with', async () => {
  const written = [7, 9].map((seed) => {
    const cloud = smallCloud(4, 0, seed);
    const [ply] = encodingsFor('a.ply', cloud);
    return ply.write({ cloud, degrees: new Uint8Array(4) });
  });
  const [early, late] = await Promise.all(written);
  const points = strToU8('ply\nformat ascii 1.0\nelement vertex 0\nend_header\n');
  const files = {
    'garden/input.ply': points,
    'garden/cfg_args': strToU8('x'),
    'garden/point_cloud/iteration_30000/point_cloud.ply': late,
    'garden/point_cloud/iteration_7000/point_cloud.ply': early,
  };
  const direct = await readScene(late, { name: 'a.ply' });
  assertSameCloud(await readScene(zipSync(files), { name: 'a.zip' }), direct);
  // Points and cameras beside or above the splats, as COLMAP, nerfstudio and others name them.
  for (const beside of ['sparse.ply', 'garden/point_cloud/x/points3D.ply', 'sparse_pc.ply', 'garden/cameras.ply'])
    assertSameCloud(await readScene(zipSync({ ...files, [beside]: points }), { name: 'a.zip' }), direct);
  const apart = zipSync({ 'a/iteration_1/point_cloud.ply': early, 'b/iteration_2/point_cloud.ply': late });
  await expectRefusal(apart, 'decode/unsupported', /2 scenes/, { name: 'a.zip' });
});

test('what archivers write beside and around files is passed over', async () => {
  const direct = await readScene(ksplat, { name: 'a.ksplat' });
  const around = {
    'a/._scene.ksplat': strToU8('x'),
    '__MACOSX/scene.ksplat': strToU8('x'),
    'meta.json': strToU8('{"author":{}}'),
  };
  const beside = zipSync({ 'a/': new Uint8Array(0), ...around, 'a/scene.ksplat': ksplat });
  assertSameCloud(await readScene(beside, { name: 'a.zip' }), direct);
  const plain = Buffer.from(zipSync({ 'scene.ksplat': ksplat }, { level: 0 }));
  const comment = Buffer.from('PK\x05\x06 is how directories begin', 'latin1');
  plain.writeUInt16LE(comment.length, plain.length - 2);
  assertSameCloud(await readScene(Buffer.concat([plain, comment]), { name: 'a.zip' }), direct);
});

/** The same archive with its one entry, its place and the directory given in 64 bits, and its sizes behind the content. */
function inZip64(content: Uint8Array, path: string, count = 1): Buffer {
  const deflated = deflateSync(content);
  const long = (...values: number[]): Buffer => Buffer.from(BigUint64Array.from(values, BigInt).buffer);
  const words = (...values: number[]): Buffer => Buffer.from(Uint32Array.from(values).buffer);
  const shorts = (...values: number[]): Buffer => Buffer.from(Uint16Array.from(values).buffer);
  const sizes = long(content.length, deflated.length);
  const local = Buffer.concat([
    ...[words(0x04034b50), shorts(45, 8, 8, 0, 0), words(0, 0, 0), shorts(path.length, 0), Buffer.from(path)],
    ...[deflated, words(0x08074b50, 0), sizes],
  ]);
  const directory = Buffer.concat([
    ...[words(0x02014b50), shorts(45, 45, 8, 8, 0, 0), words(0, 0xffffffff, 0xffffffff)],
    ...[shorts(path.length, 36, 0, 0, 0), words(0), words(0xffffffff), Buffer.from(path)],
    ...[shorts(0x5455, 4), words(0), shorts(1, 24), sizes, long(0)],
  ]);
  const end = Buffer.concat([
    ...[words(0x06064b50), long(44), shorts(45, 45), words(0, 0), long(count, count, directory.length, local.length)],
    ...[words(0x07064b50, 0), long(local.length + directory.length), words(1)],
    ...[words(0x06054b50), shorts(0, 0, 0xffff, 0xffff), words(0xffffffff, 0xffffffff), shorts(0)],
  ]);
  return Buffer.concat([local, directory, end]);
}

test('ZIP64, with sizes behind the content', async () => {
  const direct = await readScene(ksplat, { name: 'a.ksplat' });
  assertSameCloud(await readScene(inZip64(ksplat, 'scene.ksplat'), { name: 'a.zip' }), direct);
});

test('directories that announce more than they hold are refused at once', async () => {
  const start = process.cpuUsage();
  for (const count of [2, 99_999, 4e9]) {
    const code = count > 1e5 ? 'decode/unsupported' : 'decode/corrupt';
    await expectRefusal(inZip64(ksplat, 'scene.ksplat', count), code, /found (1 of|4,000)/, { name: 'a.zip' });
  }
  const { user } = process.cpuUsage(start);
  assert.ok(user < 1e6, `${user / 1e6} s`);
});

test('content that is not what was packed is refused by name', async () => {
  assert.equal(crc32(strToU8('123456789')), 0xcbf43926);
  assert.equal(crc32(new Uint8Array(0)), 0);
  const places = Array.from({ length: 8 }, (_, k) => Math.floor(((k + 1) * ksplat.length) / 9));
  for (const at of places) {
    const zip = zipSync({ 'scene.ksplat': ksplat }, { level: 0 });
    const start = Buffer.from(zip).indexOf(ksplat);
    zip[start + at] ^= 1;
    await expectRefusal(zip, 'decode/corrupt', /scene\.ksplat.*CRC-32 [0-9a-f]{8}/, { name: 'a.zip' });
  }
});

test('content that is longer than the directory says is damage, not a lack of memory', async () => {
  // Blocks without compression are copied as they are, which fails beyond the declared size.
  const zip = zipSync({ 'scene.ksplat': deflateSync(new Uint8Array(5000), { level: 0 }) }, { level: 0 });
  const view = new DataView(zip.buffer, zip.byteOffset);
  const directory = Buffer.from(zip).indexOf('PK\x01\x02', 0, 'latin1');
  view.setUint16(directory + 10, 8, true);
  view.setUint32(directory + 24, 4000, true);
  await expectRefusal(zip, 'decode/corrupt', /scene\.ksplat.*deflate/, { name: 'a.zip' });
});

test('encrypted files and compressions that are not deflate are refused by name', async () => {
  const changed = (byte: number, value: number): Uint8Array => {
    const zip = zipSync({ 'scene.ksplat': ksplat });
    zip[Buffer.from(zip).indexOf('PK\x01\x02', 0, 'latin1') + byte] = value;
    return zip;
  };
  await expectRefusal(changed(8, 1), 'decode/unsupported', /scene\.ksplat.*encrypted/, { name: 'a.zip' });
  await expectRefusal(changed(10, 14), 'decode/unsupported', /scene\.ksplat.*method 14/, { name: 'a.zip' });
  await expectRefusal(changed(42, 9), 'decode/corrupt', /scene\.ksplat.*at byte 9/, { name: 'a.zip' });
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

test('a streamed scene at all its levels reports the visible splats of each', async () => {
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
  const openFile = async (path: string): Promise<Uint8Array> => sharedFile(folder + path);
  const counts = [];
  for (const level of [3, 4, 5, 6]) {
    counts.push(
      (await readScene(sharedFile(`${folder}lod-meta.json`), { name: 'lod-meta.json', openFile, level })).count,
    );
  }
  assert.deepEqual(counts, [31_000, 8_406, 3_000, 1_873]);
});
