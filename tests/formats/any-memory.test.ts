/** A file may lie anywhere in memory, in any kind of byte array: Node's Buffers lie at odd addresses, and their `slice` does not copy. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import vm from 'node:vm';
import { readPrefix, readScene, type OpenFile } from '@gaussian-splat/formats';
import { assertSameCloud } from './support/expect.js';
import { fuzzScenes } from './support/fuzz-scenes.js';

/** The bytes as a part of a larger Buffer. */
function bufferAt(offset: number, bytes: Uint8Array): Uint8Array {
  const memory = Buffer.from(new ArrayBuffer(bytes.length + 8));
  memory.set(bytes, offset);
  return memory.subarray(offset, offset + bytes.length);
}

test('an ArrayBuffer and any view are a file, of another realm too; other values are refused by name', async () => {
  const [{ name, files }] = fuzzScenes().splat;
  const bytes = new Uint8Array(files[name]);
  const expected = await readScene(bytes, { name });
  const foreign = vm.runInNewContext('new ArrayBuffer(size)', { size: bytes.length }) as ArrayBuffer;
  new Uint8Array(foreign).set(bytes);
  for (const file of [bytes.buffer, new DataView(bytes.buffer), new Uint16Array(bytes.buffer), foreign]) {
    assertSameCloud(await readScene(file, { name }), expected);
    assertSameCloud((await readPrefix(file, { name }))!, expected);
  }
  for (const [value, found] of [
    [undefined, 'undefined'],
    [null, 'null'],
    ['scene.ply', 'string'],
    [[1, 2], 'Array'],
    [new Response(bytes), 'Response'],
  ] as const) {
    const refused = { code: 'argument/value', message: new RegExp(found) };
    await assert.rejects(readScene(value as unknown as Uint8Array, { name }), refused);
    await assert.rejects(readPrefix(value as unknown as Uint8Array, { name }), refused);
  }
});

for (const [format, scenes] of Object.entries(fuzzScenes())) {
  test(`${format}: Buffers at any address give the same cloud`, async () => {
    for (const { name, files } of scenes) {
      const read = (place: (bytes: Uint8Array) => Uint8Array): ReturnType<typeof readScene> => {
        const openFile: OpenFile = async (path) => place(files[path]);
        return readScene(place(files[name]), { name, openFile });
      };
      const expected = await read((bytes) => new Uint8Array(bytes));
      assert.ok(expected.count > 0);
      for (const offset of [0, 1, 2, 3]) assertSameCloud(await read((bytes) => bufferAt(offset, bytes)), expected);
    }
  });
}
