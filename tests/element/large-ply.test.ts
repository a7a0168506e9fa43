/** A large PLY whose download starts again, and brings another file than before. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { LargePly } from '../../packages/element/src/loading/large-ply.js';
import { writePly } from '../formats/support/ply-writer.js';
import { inriaColumns, rawSplats } from '../formats/support/splats.js';

const plyOf = (count: number): Uint8Array => writePly([{ name: 'vertex', columns: inriaColumns(rawSplats(count, 0)) }]);

test('a file with another header than the one whose download began is read as a whole', async () => {
  const [first, second] = [plyOf(20), plyOf(40)];
  const request = { url: 'https://a.test/a.ply', credentials: 'same-origin', sh: 'auto' } as const;
  const { signal } = new AbortController();
  const listeners = { onProgress: () => undefined };
  const ply = await LargePly.open(first, first.length, 'a.ply', request, () => ({}), signal, listeners);
  assert.ok(ply, 'its rows can be read by several threads');
  await ply.onArrival(first);
  await ply.onArrival(second.subarray(0, 100));
  assert.equal(await ply.finish(second), undefined);
});
