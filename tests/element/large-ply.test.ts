/** A large PLY whose download starts again, and brings another file than before. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { LargePly } from '../support/element/loading.js';
import { writePly } from '../formats/support/ply-writer.js';
import { inriaColumns, rawSplats } from '../formats/support/splats.js';

const plyOf = (count: number): Uint8Array => writePly([{ name: 'vertex', columns: inriaColumns(rawSplats(count, 0)) }]);

test('a file with another header than the one whose download began is read as a whole', async () => {
  const [first, second] = [plyOf(20), plyOf(40)];
  const request = { url: 'https://a.test/a.ply', credentials: 'same-origin', sh: 'auto' } as const;
  const listeners = { onProgress: () => undefined };
  const ply = await LargePly.open(first, first.length, 'a.ply', request, () => ({}), listeners);
  assert.ok(ply, 'its rows can be packed while they arrive');
  assert.ok(await ply.onArrival(first, 0), 'its bytes are not kept');
  assert.ok(!(await ply.onArrival(second.subarray(0, 100), 0)));
  assert.equal(await ply.finish(), undefined);
  assert.ok(ply.hasTaken, 'the file must be fetched again');
});
