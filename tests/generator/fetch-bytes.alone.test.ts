/** Memory of downloads: the bytes that are allocated for a file. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { fetchBytes } from '../../packages/generator/src/runtime/fetch-bytes.js';

const MIB = 2 ** 20;

/** Downloads a file of `sent` bytes whose server declares `declared`. @returns The sizes of all allocations. */
async function allocationsOf(sent: number, declared: number | undefined): Promise<number[]> {
  const Own = globalThis.Uint8Array;
  const chunk = new Own(4 * MIB).fill(7);
  let left = sent;
  const body = new ReadableStream<Uint8Array>({
    pull: (controller) => {
      if (left === 0) return controller.close();
      const part = chunk.subarray(0, Math.min(left, chunk.length));
      left -= part.length;
      controller.enqueue(part);
    },
  });
  const headers: Record<string, string> = declared === undefined ? {} : { 'Content-Length': String(declared) };
  const fetchBefore = globalThis.fetch;
  const sizes: number[] = [];
  globalThis.fetch = () => Promise.resolve(new Response(body, { headers }));
  globalThis.Uint8Array = new Proxy(Own, {
    construct: (target, given: [number]) => {
      if (typeof given[0] === 'number' && given[0] >= MIB) sizes.push(given[0]);
      return Reflect.construct(target, given) as Uint8Array;
    },
  });
  try {
    const bytes = await fetchBytes('model.onnx', { onProgress: () => undefined });
    assert.deepEqual([bytes.length, bytes[0], bytes[sent - 1]], [sent, 7, 7]);
  } finally {
    globalThis.fetch = fetchBefore;
    globalThis.Uint8Array = Own;
  }
  return sizes;
}

test('a download of a declared length takes at most 1.4 times its file', async () => {
  for (const size of [8, 200, 260, 400].map((each) => each * MIB)) {
    const sizes = await allocationsOf(size, size);
    // Two buffers exist at once while the first is copied.
    assert.ok(sizes.reduce((sum, each) => sum + each, 0) <= 1.4 * size, `${size}: ${String(sizes)}`);
  }
});

test('a server that declares more than it sends gets little before it sends', async () => {
  const sizes = await allocationsOf(8 * MIB, 1900 * MIB);
  assert.ok(Math.max(...sizes) <= 64 * MIB, String(sizes));
});
