/** Files that are odd but clear: what programs other than trainers make of scenes, and archives of more than a scene. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { strToU8, zipSync } from 'fflate';
import { detectFormat, readScene, readSplats, splatRanges } from '@gaussian-splat/formats';
import { assertSameCloud, expectRefusal, largestDifference } from './support/expect.js';
import { buildGltf } from './support/gltf-writer.js';
import { writePly, type PlyColumn } from './support/ply-writer.js';
import { smallCloud } from './support/small-cloud.js';
import { writeSog, type SogFiles } from './support/sog-writer.js';
import { inriaColumns, rawSplats } from './support/splats.js';

const columns = inriaColumns(rawSplats(5, 1));
const within = (folder: string, files: SogFiles): SogFiles =>
  Object.fromEntries(Object.entries(files).map(([path, bytes]) => [`${folder}/${path}`, bytes]));
const joined = (...parts: readonly Uint8Array[]): Uint8Array => new Uint8Array(Buffer.concat(parts));

test('fields that CloudCompare has renamed are found in parts, too', async () => {
  const renamed = columns.map((column) =>
    'xyz'.includes(column.name) ? column : { ...column, name: `scalar_${column.name}` },
  );
  const [plain, file] = [columns, renamed].map((own) => writePly([{ name: 'vertex', columns: own }]));
  assert.deepEqual((await splatRanges(file, 'a.ply'))?.count, 5);
  const range = { first: 1, end: 4 };
  assertSameCloud(await readSplats(file, range, 'a.ply'), await readSplats(plain, range, 'a.ply'));
});

test('integers of 64 bits in a PLY are skipped, and read where they are coordinates', async () => {
  const splats = rawSplats(3, 1);
  const own = inriaColumns(splats);
  const places = splats.positions.map((p) => p.map((value) => 6_000_000_000_000 + Math.round(value)));
  for (const encoding of ['ascii', 'binary_little_endian', 'binary_big_endian'] as const) {
    const plain = await readScene(writePly([{ name: 'vertex', columns: own }], { encoding }));
    for (const [signed, unsigned] of [['int64', 'uint64'] as const, ['longlong', 'ulonglong'] as const]) {
      const face = { name: 'ids', type: unsigned, listCountType: unsigned, values: [[1, 2 ** 50], []] };
      const time = { name: 'time', type: signed, values: [-1, 2 ** 40, 7] };
      const id = { name: 'id', type: unsigned, values: [5, 6] };
      const read = (vertex: readonly PlyColumn[]) => {
        const elements = [
          { name: 'face', columns: [face, id] },
          { name: 'vertex', columns: [time, ...vertex] },
        ];
        return readScene(writePly(elements, { encoding }));
      };
      assertSameCloud(await read(own), plain);
      const moved = own.map((column) => {
        const axis = 'xyz'.indexOf(column.name);
        return axis < 0 ? column : { ...column, type: signed, values: places.map((p) => p[axis]) };
      });
      const { positions, origin } = await read(moved);
      const world = Array.from(positions, (value, i) => value + origin[i % 3]);
      assert.equal(largestDifference(world, places.flat()), 0, `${encoding} ${signed}`);
    }
  }
  const one = own.map((c) => (c.name === 'y' ? { ...c, type: 'int64' as const, values: [1, 2, 3] } : c));
  const file = writePly([{ name: 'vertex', columns: one }]);
  assert.equal(await splatRanges(file, 'a.ply'), undefined, 'an origin that all splats decide');
});

test('a page that is only comments is refused at once', async () => {
  // Each way to divide the comments among two loops was tried: 2 s for 28 comments, twice as long for each further one.
  const [file, start] = [strToU8('<!---->'.repeat(28)), process.cpuUsage()];
  await expectRefusal(file, 'decode/unknown-format', /file/);
  await expectRefusal(strToU8(`${'<!-- a -->\n'.repeat(28)}<html>`), 'decode/html', /page/);
  assert.ok(process.cpuUsage(start).user < 1e6);
});

test('a PLY may begin with the byte-order mark that text editors write', async () => {
  for (const newline of ['\n', '\r\n', '\r'] as const) {
    const plain = writePly([{ name: 'vertex', columns }], { encoding: 'ascii', newline });
    const marked = joined(Uint8Array.of(0xef, 0xbb, 0xbf), plain);
    assertSameCloud(await readScene(marked, { name: 'a.txt' }), await readScene(plain, { name: 'a.ply' }));
  }
});

test('a meta.json of another program hides no scene, and of two scenes none is chosen', async () => {
  const files = writeSog(smallCloud(40, 1));
  const direct = await readScene(zipSync(files), { name: 'a.sog' });
  const other = strToU8('{"author":"x"}');
  for (const path of ['meta.json', 'a/meta.json', 'z/meta.json', 'a/b/c/meta.json']) {
    assertSameCloud(await readScene(zipSync({ [path]: other, ...within('scene', files) }), { name: 'a.zip' }), direct);
  }
  const large = { ...files, 'meta.json': new Uint8Array(2 ** 20 + 1).fill(32) };
  const { message } = await expectRefusal(zipSync(large), 'decode/corrupt', /1,048,577/, { name: 'a.sog' });
  assert.match(message, /^a\.sog, meta\.json: expected a description of at most 1,048,576 bytes/);
  // Images further down may be the source of the one above.
  const deeper = { ...files, ...within('old', files) };
  assertSameCloud(await readScene(zipSync(deeper), { name: 'a.zip' }), direct);
  const two = zipSync({ ...within('a', files), ...within('b', files) });
  await expectRefusal(two, 'decode/unsupported', /2 scenes: "a\/meta\.json", "b\/meta\.json"/, { name: 'a.zip' });
});

test('archives without files, and those of one volume that say so, are known as archives', async () => {
  await expectRefusal(zipSync({}), 'decode/unknown-format', /a ZIP archive with no files/, { name: 'a.zip' });
  const cloud = smallCloud(40, 1);
  for (const mark of ['PK00', 'PK\x07\x08']) {
    const zip = zipSync(writeSog(cloud), { level: 0 });
    const view = Buffer.from(zip);
    // Places are counted from the beginning of the file.
    const end = view.indexOf('PK\x05\x06', 0, 'latin1');
    for (let at = view.readUInt32LE(end + 16); at < end;) {
      view.writeUInt32LE(view.readUInt32LE(at + 42) + 4, at + 42);
      at += 46 + view.readUInt16LE(at + 28) + view.readUInt16LE(at + 30) + view.readUInt16LE(at + 32);
    }
    view.writeUInt32LE(view.readUInt32LE(end + 16) + 4, end + 16);
    const found = await readScene(joined(Buffer.from(mark, 'latin1'), view), { name: 'a.sog' });
    assertSameCloud(found, await readScene(zipSync(writeSog(cloud)), { name: 'a.sog' }));
  }
});

test('the index of a large streamed scene is recognized in any order of its keys', () => {
  const filenames = Array.from({ length: 3000 }, (_, k) => `${k}_0/meta.json`);
  const tree = { children: Array.from({ length: 2000 }, (_, k) => ({ lods: { 0: { file: k } } })) };
  for (const index of [
    { asset: {}, count: 1, filenames, lodLevels: 1, tree },
    { lodLevels: 1, filenames, tree },
    { tree, lodLevels: 1, filenames: filenames.slice(0, 9) },
  ]) {
    assert.equal(detectFormat(strToU8(JSON.stringify(index)), 'lod-meta.json'), 'lod');
  }
});

/** A GLB as some writers make it: `pad` behind the JSON, and something behind the end. */
function glb(json: object, binary: Uint8Array | undefined, pad: string, behind: string): Uint8Array {
  const words = (...values: number[]): Uint8Array => new Uint8Array(Uint32Array.from(values).buffer);
  const text = Buffer.from(JSON.stringify(json));
  const padded = Buffer.concat([text, Buffer.alloc(4 + (-text.length & 3), pad)]);
  const chunks = [words(padded.length), Buffer.from('JSON'), padded];
  if (binary) chunks.push(words(binary.length), Buffer.from('BIN\0'), binary);
  const length = 12 + chunks.reduce((sum, chunk) => sum + chunk.length, 0);
  return joined(Buffer.from('glTF'), words(2, length), ...chunks, Buffer.from(behind));
}

test('a GLB may be padded with zeros, and what stands behind its end is not part of it', async () => {
  const { json, buffer } = buildGltf([[{ cloud: smallCloud(6, 1) }]], [{ mesh: 0 }], [0]);
  const [own, beside] = [{ byteLength: buffer.length }, { uri: 'a.bin', byteLength: buffer.length }];
  const read = (file: Uint8Array) => readScene(file, { name: 'a.glb', openFile: async () => buffer });
  const direct = await read(glb({ ...json, buffers: [own] }, buffer, ' ', ''));
  for (const [pad, behind] of [
    ['\0', ''],
    [' ', 'something else'],
    ['\0', 'something else'],
  ]) {
    // prettier-ignore
    assertSameCloud(await read(glb({ ...json, buffers: [own] }, buffer, pad, behind)), direct);
    assertSameCloud(await read(glb({ ...json, buffers: [beside] }, undefined, pad, behind)), direct);
  }
});

test('an ASCII PLY that is cut within a number is incomplete, not damaged', async () => {
  const file = writePly([{ name: 'vertex', columns }], { encoding: 'ascii' });
  const at = Buffer.from(file).lastIndexOf('-');
  await expectRefusal(file.subarray(0, at + 1), 'decode/truncated', /byte [\d,]+: expected a number, found "-"/);
  file[at + 1] = 45;
  await expectRefusal(file, 'decode/corrupt', /expected a number, found "--/);
});
