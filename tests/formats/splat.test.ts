import assert from 'node:assert/strict';
import { test } from 'node:test';
import { detectFormat, readScene } from '@gaussian-splat/formats';
import { assertAtMost, assertSameCloud, expectRefusal, largestDifference } from './support/expect.js';
import { rawSplats } from './support/splats.js';

const clampByte = (value: number): number => Math.min(255, Math.max(0, Math.round(value)));

/** Files of 32 bytes a splat, written as antimatter15's converter describes them. */
function writeSplat(splats: ReturnType<typeof rawSplats>): Uint8Array {
  const file = Buffer.alloc(32 * splats.count);
  for (let i = 0; i < splats.count; i++) {
    splats.positions[i].forEach((value, k) => file.writeFloatLE(value, 32 * i + 4 * k));
    splats.logScales[i].forEach((value, k) => file.writeFloatLE(Math.exp(value), 32 * i + 12 + 4 * k));
    splats.sh[i][0].forEach(
      (value, k) => (file[32 * i + 24 + k] = clampByte(255 * (0.5 + 0.28209479177387814 * value))),
    );
    file[32 * i + 27] = clampByte(255 / (1 + Math.exp(-splats.logits[i])));
    splats.rotations[i].forEach((value, k) => (file[32 * i + 28 + k] = clampByte(128 + 128 * value)));
  }
  return new Uint8Array(file);
}

test('every value arrives', async () => {
  const splats = rawSplats(100, 0);
  const cloud = await readScene(writeSplat(splats), { name: 'a.splat' });
  assert.equal(cloud.count, 100);
  assert.equal(cloud.shDegree, 0);
  assert.equal(largestDifference(cloud.positions, splats.positions.flat()), 0);
  assertAtMost(largestDifference(cloud.scales, splats.logScales.flat().map(Math.exp)), 3e-7, 'scales');
  assertAtMost(largestDifference(cloud.sh, splats.sh.flat(2)), 0.5 / 255 / 0.28209479177387814 + 1e-6, 'colors');
  const opacities = splats.logits.map((logit) => 1 / (1 + Math.exp(-logit)));
  assertAtMost(largestDifference(cloud.opacities, opacities), 0.5 / 255 + 1e-6, 'opacities');
  assertAtMost(largestDifference(cloud.rotations, splats.rotations.flat()), 0.02, '8 bits, normalized');
});

test('the same bytes at an odd address give the same cloud', async () => {
  const file = writeSplat(rawSplats(10, 0));
  const shifted = new Uint8Array(file.length + 3).subarray(3);
  shifted.set(file);
  assertSameCloud(await readScene(shifted), await readScene(file));
});

test('the format is recognized by the extension, the media type or plausible numbers', () => {
  const file = writeSplat(rawSplats(100, 0));
  const odd = Uint8Array.from(file);
  odd.fill(255, 0, 32);
  assert.equal(detectFormat(file), 'splat');
  assert.equal(detectFormat(odd), undefined, 'one record that is none speaks against it');
  assert.equal(detectFormat(odd, 'https://host/a/scene.SPLAT?v=2#x'), 'splat');
  for (const name of ['scene #3.splat', 'what?.splat', 'https://host/get?file=scene.splat'])
    assert.equal(detectFormat(odd, name), 'splat', name);
  assert.equal(detectFormat(odd, 'https://host/scene.txt?like=a.splat'), undefined);
  assert.equal(detectFormat(odd, 'scene', 'application/x-splat; charset=binary'), 'splat');
  assert.equal(detectFormat(odd, 'scene.splat.txt'), undefined);
  assert.equal(detectFormat(file.subarray(0, -1)), undefined);
});

test('lengths that are no multiple of 32 are truncated', async () => {
  const file = writeSplat(rawSplats(3, 0));
  const error = /byte 95 .*multiple of 32 bytes.*2 whole splats and 31 bytes/;
  await expectRefusal(file.subarray(0, 95), 'decode/truncated', error, { name: 'x.splat' });
});

test('other content under the name .splat is refused', async () => {
  const noise = Uint8Array.from({ length: 3200 }, (_, i) => (i * 2654435761) >>> 13);
  await expectRefusal(noise, 'decode/corrupt', /finite positions/, { name: 'x.splat' });
  const page = new TextEncoder().encode('<html><head><title>404</title></head>'.padEnd(64));
  await expectRefusal(page, 'decode/html', /web page/, { name: 'x.splat' });
});

test('a record without a rotation is dropped', async () => {
  const file = writeSplat(rawSplats(3, 0));
  file.fill(128, 28, 32);
  const cloud = await readScene(file, { name: 'x.splat' });
  assert.deepEqual([cloud.count, cloud.droppedCount], [2, 1]);
});

test('its first bytes may be those of a text, of gzip or of anything else', async () => {
  const file = writeSplat(rawSplats(20, 0));
  for (const first of ['[0', '{"', '[-', '<a ', '\x1f\x8b', 'GIF8', '%PDF', '<htm']) {
    const one = file.slice();
    for (let k = 0; k < first.length; k++) one[k] = first.charCodeAt(k);
    // A number that a center may be.
    one[3] = 0x3f;
    assert.equal(detectFormat(one, 'a.splat'), 'splat', JSON.stringify(first));
    assert.equal((await readScene(one, { name: 'a.splat' })).count, 20);
  }
  await expectRefusal(new TextEncoder().encode('<!doctype html><p>not here</p>'), 'decode/html', /web page/, {
    name: 'a.splat',
  });
});

test('the end of a line behind the last splat does no harm, a part of another splat is missing the rest', async () => {
  const file = writeSplat(rawSplats(20, 0));
  const longer = (...bytes: number[]): Uint8Array => Uint8Array.of(...file, ...bytes);
  assertSameCloud(await readScene(longer(13, 10), { name: 'a.splat' }), await readScene(file, { name: 'a.splat' }));
  await expectRefusal(longer(13, 10, 1), 'decode/truncated', /20 whole splats and 3 bytes/, { name: 'a.splat' });
});
