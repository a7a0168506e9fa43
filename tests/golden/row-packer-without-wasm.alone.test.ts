/** Browsers without WebAssembly, and pages whose policy forbids it, pack in JavaScript. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { packGaussians } from '@gaussian-splat/renderer';
import { packCloud, RowPacker } from '@gaussian-splat/renderer/tools';
import { LargePly } from '../support/element/loading.js';
import { writePly } from '../formats/support/ply-writer.js';
import { inriaColumns, rawSplats } from '../formats/support/splats.js';
import { cloudOf, repeat } from '../support/clouds.js';

WebAssembly.compile = () => Promise.reject(new WebAssembly.CompileError('the policy forbids it'));

test('a cloud is packed to the same bytes', async () => {
  const cloud = cloudOf(
    repeat(3000, (i) => ({ position: [i % 17, i % 13, i % 11], scale: 0.1, opacity: 0.5, color: [1, 0, 0] })),
  );
  assert.equal(await RowPacker.open(1, { shDegree: 0, shPrecision: 'int8', moved: [0, 0, 0] }), undefined);
  assert.deepEqual(await packCloud(cloud), packGaussians(cloud));
});

test('a large PLY is read as a whole, and all of its bytes are kept', async () => {
  const bytes = writePly([{ name: 'vertex', columns: inriaColumns(rawSplats(200, 0)) }]);
  const request = { url: 'https://a.test/a.ply', credentials: 'same-origin', sh: 'auto' } as const;
  const listeners = { onProgress: () => undefined };
  const ply = await LargePly.open(bytes, bytes.length, 'a.ply', request, () => ({}), listeners);
  assert.ok(ply);
  assert.equal(await ply.onArrival(bytes), false);
  assert.equal(ply.hasTaken, false);
  assert.equal(await ply.finish(), undefined);
});
