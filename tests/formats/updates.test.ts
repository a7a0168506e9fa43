/** Messages with updates of scenes: what is written is what is read, in parts of any lengths, and nothing else is. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { GaussianSplatError } from '@gaussian-splat/core';
import { checkUpdate, decodeUpdate, encodeUpdate, updatesIn, type SplatUpdate } from '@gaussian-splat/formats/updates';

const numbers = (length: number, from = 0): Float32Array => Float32Array.from({ length }, (_, i) => from + i / 8);

function sceneOf(count: number, more: Partial<SplatUpdate> = {}): SplatUpdate {
  return {
    positions: numbers(3 * count),
    scales: numbers(3 * count, 1),
    rotations: numbers(4 * count, 2),
    opacities: numbers(count, 3),
    colors: numbers(3 * count, 4),
    ...more,
  };
}

const hasCode =
  (code: string, ...words: RegExp[]) =>
  (error: unknown): boolean => {
    assert.ok(error instanceof GaussianSplatError);
    assert.equal(error.code, code);
    for (const word of words) assert.match(error.message, word);
    return true;
  };

const all = async (stream: ReadableStream<Uint8Array>, maxBytes?: number): Promise<SplatUpdate[]> => {
  const updates: SplatUpdate[] = [];
  for await (const update of updatesIn(stream, { maxBytes })) updates.push(update);
  return updates;
};

function streamOf(bytes: Uint8Array, size: number): ReadableStream<Uint8Array> {
  let at = 0;
  return new ReadableStream({
    pull: (controller) => {
      if (at >= bytes.length) return controller.close();
      controller.enqueue(bytes.slice(at, at + size));
      at += size;
    },
  });
}

test('a whole scene is read as it was written, without copies of its arrays', () => {
  const update = sceneOf(5, { raw: true, filter: 'mip', step: 4_000_000_000, origin: [1e6 + 0.25, -2, 3] });
  const message = encodeUpdate(update);
  assert.equal(message.byteLength, 48 + 4 * 5 * 14);
  const read = decodeUpdate(message);
  assert.deepEqual({ ...read }, { ...update, first: undefined, shDegree: 0 });
  assert.equal(read.positions!.buffer, message);
});

test('the header has the bytes of docs/guide/changing-scenes.md', () => {
  const view = new DataView(
    encodeUpdate({ first: 7, step: 9, sh: numbers(2 * 12), shDegree: 1, raw: true, filter: 'antialiased' }),
  );
  assert.equal(String.fromCharCode(...new Uint8Array(view.buffer, 0, 4)), 'GSUP');
  assert.deepEqual([...new Uint8Array(view.buffer, 4, 4)], [1, 1 | 2 | 4, 16, 1]);
  assert.deepEqual(
    [8, 12, 16, 20].map((at) => view.getUint32(at, true)),
    [9, 7, 2, 0],
  );
  assert.equal(view.getFloat32(48 + 4 * 23, true), 23 / 8);
});

test('harmonics of each degree, alone and beside other arrays', () => {
  for (const shDegree of [0, 1, 2, 3] as const) {
    const sh = numbers(3 * (shDegree + 1) ** 2 * 3);
    const update = sceneOf(3, { colors: undefined, sh });
    assert.deepEqual(checkUpdate(update), { count: 3, shDegree });
    assert.deepEqual(decodeUpdate(encodeUpdate(update)).sh, sh);
    assert.deepEqual(checkUpdate({ first: 0, sh, shDegree }), { count: 3, shDegree });
  }
});

test('a stream yields its messages for parts of any length, also those that begin unaligned', async () => {
  const updates = [sceneOf(40), { first: 3, step: 2, opacities: numbers(5) }, sceneOf(0), sceneOf(1, { step: 7 })];
  const messages = updates.map((update) => new Uint8Array(encodeUpdate(update)));
  const bytes = new Uint8Array(messages.reduce((sum, { length }) => sum + length, 0));
  messages.reduce((at, message) => (bytes.set(message, at), at + message.length), 0);
  const expected = messages.map((message) => decodeUpdate(message));
  for (const size of [1, 7, 48, 100, 2250, bytes.length])
    assert.deepEqual(await all(streamOf(bytes, size)), expected, `parts of ${size} bytes`);
  assert.deepEqual(
    decodeUpdate(bytes.subarray(messages[0].length, messages[0].length + messages[1].length)),
    expected[1],
  );
  const shifted = new Uint8Array(messages[0].length + 1);
  shifted.set(messages[0], 1);
  assert.deepEqual(decodeUpdate(shifted.subarray(1)), expected[0]);
});

test('a stream that ends within a message, and one above the limit, are errors before any more is read', async () => {
  const bytes = new Uint8Array(encodeUpdate(sceneOf(100)));
  for (const length of [1, 47, 48, bytes.length - 1])
    await assert.rejects(
      all(streamOf(bytes.slice(0, length), 64)),
      hasCode('decode/truncated', /the end of the stream/),
    );
  let isCanceled = false;
  const endless = new ReadableStream<Uint8Array>({
    pull: (controller) => controller.enqueue(bytes.slice(0, 48)),
    cancel: () => void (isCanceled = true),
  });
  await assert.rejects(all(endless, 5_000), hasCode('out-of-memory/budget', /5000 bytes/, /5648 bytes/));
  assert.ok(isCanceled);
});

test('each byte of a header that is not as documented is an error', () => {
  const changed = (at: number, value: number): Uint8Array<ArrayBuffer> => {
    const bytes = new Uint8Array(encodeUpdate(sceneOf(2)));
    bytes[at] = value;
    return bytes;
  };
  const cases: [at: number, value: number, code: string][] = [
    [0, 0, 'decode/header'],
    [4, 2, 'decode/unsupported'],
    [5, 16, 'decode/header'],
    [5, 12, 'decode/header'],
    [6, 0, 'decode/header'],
    [6, 32 | 7, 'decode/header'],
    [6, 15, 'decode/header'],
    [6, 63, 'decode/header'],
    [7, 1, 'decode/header'],
    [16, 3, 'decode/truncated'],
    [19, 255, 'decode/truncated'],
    [20, 1, 'decode/header'],
  ];
  for (const [at, value, code] of cases)
    assert.throws(() => decodeUpdate(changed(at, value)), hasCode(code), `byte ${at} is ${value}`);
  const infinite = changed(31, 0x7f);
  infinite[30] = 0xf0;
  assert.throws(() => decodeUpdate(infinite), hasCode('decode/header', /finite origin/));
  assert.throws(() => decodeUpdate(new Uint8Array(47)), hasCode('decode/truncated'));
});

test('arrays that do not match are errors that name the array', () => {
  const fails = (update: SplatUpdate, ...words: RegExp[]): void =>
    assert.throws(() => encodeUpdate(update), hasCode('argument/cloud', ...words));
  fails(sceneOf(2, { scales: numbers(5) }), /splats\.scales/, /3 numbers a splat/, /5 for 2 splats/);
  fails(sceneOf(2, { positions: numbers(7) }), /splats\.positions/, /7 numbers/);
  fails(sceneOf(2, { rotations: undefined }), /splats\.rotations/, /none/);
  fails(sceneOf(2, { colors: undefined }), /either sh or colors/, /neither/);
  fails(sceneOf(2, { sh: numbers(6) }), /either sh or colors/, /both/);
  fails(sceneOf(2, { colors: undefined, sh: numbers(10) }), /3, 12, 27, 48 numbers a splat/);
  fails({ first: 0, sh: numbers(12) }, /shDegree/);
  fails({ first: 0 }, /none/);
  fails(sceneOf(2, { opacities: [1, 1] as unknown as Float32Array }), /splats\.opacities/, /Float32Array/);
  assert.throws(() => encodeUpdate({ first: -1, opacities: numbers(1) }), hasCode('argument/value', /first/));
  assert.throws(() => encodeUpdate(sceneOf(1, { step: 0.5 })), hasCode('argument/value', /step/));
});
