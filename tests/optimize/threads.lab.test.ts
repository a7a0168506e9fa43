/** Threads do the work that has parts: the same bytes, the same clouds and the same errors as without. */
import assert from 'node:assert/strict';
import { mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, test } from 'node:test';
import type { GaussianCloud } from '@gaussian-splat/core';
import { encodingsFor, type ReducedCloud } from '@gaussian-splat/optimize';
import { inline } from '@gaussian-splat/optimize/parts';
import { readScene } from '@gaussian-splat/formats';
import { readInParts } from '../../packages/optimize/src/parts/read-in-parts.js';
import { reduceInParts, reduceTo } from '../../packages/optimize/src/reduce.js';
import { startReading } from '../../packages/cli/src/lib/scene-in-parts.mjs';
import { ThreadPool } from '../../packages/cli/src/lib/thread-pool.mjs';
import { assertSameCloud } from '../formats/support/expect.js';
import { smallCloud } from '../formats/support/small-cloud.js';

const readInThreads = async (path: string, pool: ThreadPool): Promise<GaussianCloud> =>
  (await startReading(path, pool)).cloud;

const COUNT = 120_000;
const folder = mkdtempSync(join(tmpdir(), 'threads-'));
const pool = new ThreadPool(3, 1000);

after(async () => {
  await pool.close();
  rmSync(folder, { recursive: true });
});

/** Many splats of degree 1, no two alike: those of a few, moved. */
function scene(): GaussianCloud {
  const few = smallCloud(1000, 1, 3);
  const repeated = (values: Float32Array): Float32Array => {
    const all = new Float32Array(new SharedArrayBuffer((COUNT / few.count) * values.byteLength));
    for (let at = 0; at < all.length; at += values.length) all.set(values, at);
    return all;
  };
  const positions = repeated(few.positions).map((value, k) => value + Math.floor(k / 3000));
  const shared = new Float32Array(new SharedArrayBuffer(positions.byteLength));
  shared.set(positions);
  const [scales, rotations, opacities, sh] = [few.scales, few.rotations, few.opacities, few.sh].map(repeated);
  return { ...few, count: COUNT, positions: shared, scales, rotations, opacities, sh };
}

const whole = scene();
/** Nine tenths of the splats, backwards; every third keeps its degree. */
const kept = Uint32Array.from({ length: 0.9 * COUNT }, (_, k) => COUNT - 1 - k - Math.floor(k / 9));
const degrees = Uint8Array.from(kept, (_, k) => (k % 3 === 0 ? 1 : 0));
const reduced: ReducedCloud = reduceTo(whole, { kept, degrees });
const [glb, ply] = [encodingsFor('a.glb')[0], encodingsFor('a.ply')[0]];

const inFolder = (name: string, bytes: Uint8Array): string => {
  const path = join(folder, name);
  writeFileSync(path, bytes);
  return path;
};

test('threads leave the same cloud and write the same file, which they read as one thread does', async () => {
  const { cloud } = await reduceInParts(whole, { kept, degrees }, pool);
  assertSameCloud(cloud, reduced.cloud);
  assert.ok(pool.shares(cloud.sh.buffer));
  const alone = await glb.write(reduced);
  const together = await glb.write({ cloud, degrees }, pool);
  assert.ok(Buffer.from(alone).equals(together));
  const read = await readInParts(together, { name: 'a.glb' }, pool);
  assert.ok(pool.shares(read.sh.buffer));
  assertSameCloud(read, await readScene(alone, { name: 'a.glb' }));
});

test('a PLY is read by threads as by one, without splats that cannot be drawn', async () => {
  const bytes = await ply.write(reduced);
  const numbers = new DataView(bytes.buffer);
  const rowBytes = 4 * 23;
  const start = bytes.length - rowBytes * reduced.cloud.count;
  // In the first part, at the border of two parts, and at the end.
  for (const row of [0, 7, 35_999, 36_000, 36_001, reduced.cloud.count - 1]) {
    numbers.setFloat32(start + rowBytes * row, NaN, true);
  }
  const read = await readInThreads(inFolder('scene.ply', bytes), pool);
  assert.ok(pool.shares(read.sh.buffer));
  assert.equal(read.droppedCount, 6);
  assertSameCloud(read, await readScene(bytes, { name: 'scene.ply' }));
});

test('what is small, or in a format that is read at once, comes in shared memory, too', async () => {
  const few = smallCloud(50, 2);
  const whole50 = { cloud: few, degrees: new Uint8Array(50).fill(2) };
  for (const name of ['few.ply', 'few.spz']) {
    const bytes = await encodingsFor(name).at(-1)!.write(whole50);
    const read = await readInThreads(inFolder(name, bytes), pool);
    assert.ok(pool.shares(read.sh.buffer), name);
    assertSameCloud(read, await readScene(bytes, { name }));
  }
});

test('errors of threads are those that a single one would meet', async () => {
  const bytes = await ply.write(reduced);
  const cut = inFolder('cut.ply', bytes.subarray(0, -4));
  const expected = { code: 'decode/truncated', name: 'GaussianSplatError', message: /incomplete/ };
  await assert.rejects(readInThreads(cut, pool), expected);
  await assert.rejects(readInThreads(join(folder, 'none.ply'), pool), { code: 'ENOENT' });
  const nothing = await ply.write({
    ...reduced,
    cloud: { ...reduced.cloud, scales: reduced.cloud.scales.map(() => 0) },
  });
  // A scale of 0 is written as a logarithm that is not finite, and read as 0.
  await assert.rejects(readInThreads(inFolder('nothing.ply', nothing), pool), { code: 'decode/empty' });

  const file = await glb.write(reduced, pool);
  const text = Buffer.from(file.buffer, file.byteOffset, file.byteLength);
  const at = text.indexOf('"componentType":5126', text.indexOf('"VEC3"') + 1);
  text.write('"componentType":5199', at);
  const message = await readScene(file, { name: 'a.glb' }).catch((error: Error) => error.message);
  assert.match(String(message), /componentType.*decode\/header/);
  await assert.rejects(readInParts(file, { name: 'a.glb' }, pool), { code: 'decode/header', message });
  // The threads continue.
  assert.equal((await readInThreads(inFolder('scene.ply', bytes), pool)).count, reduced.cloud.count);
});

test('one part, or memory that is not shared, is done where it is asked for', async () => {
  const lonely = new ThreadPool(2);
  lonely.start = () => assert.fail('threads were started');
  const few = smallCloud(500, 1);
  const some = { cloud: few, degrees: new Uint8Array(500).map((_, k) => k % 2) };
  assert.ok(Buffer.from(await glb.write(some)).equals(await glb.write(some, lonely)));
  const own = { ...whole, sh: Float32Array.from(whole.sh) };
  const { cloud } = await reduceInParts(own, { kept, degrees }, lonely);
  assertSameCloud(cloud, reduced.cloud);
  assertSameCloud((await reduceInParts(whole, { kept, degrees }, inline)).cloud, reduced.cloud);
});
