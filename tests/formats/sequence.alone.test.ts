import assert from 'node:assert/strict';
import { test } from 'node:test';
import { frameAt, framePath, isSequence, parseSequence, sequencePaths } from '@gaussian-splat/formats';
import { expectRefusal } from './support/expect.js';

const text = (json: unknown): Uint8Array => new TextEncoder().encode(JSON.stringify(json));
const manifest = (rest: object): Uint8Array => text({ gaussianSplatSequence: 1, framesPerSecond: 24, ...rest });

test('a list and a numbered pattern', () => {
  const listed = parseSequence(manifest({ frames: ['a.spz', 'b.spz', 'c.ply'] }), 'a.json');
  const times = { framesPerSecond: 24, durationSeconds: 0.125 };
  assert.deepEqual(listed, { frames: ['a.spz', 'b.spz', 'c.ply'], frameCount: 3, ...times });
  const numbered = parseSequence(manifest({ frames: 'f/{0098}.spz', count: 4 }), 'a.json');
  assert.deepEqual([...sequencePaths(numbered)], ['f/0098.spz', 'f/0099.spz', 'f/0100.spz', 'f/0101.spz']);
  assert.ok(isSequence(manifest({ frames: [] })) && !isSequence(text({ means: {} })));
});

test('a manifest may begin with space and with a byte-order mark', () => {
  const inner = new TextDecoder().decode(manifest({ frames: ['a.spz'] }));
  for (const before of ['\n  ', '\ufeff', '\ufeff\r\n']) {
    const bytes = new TextEncoder().encode(before + inner);
    assert.ok(isSequence(bytes), JSON.stringify(before));
    assert.deepEqual(parseSequence(bytes, 'a.json').frames, ['a.spz']);
  }
});

test('a pattern is as short as it is written, for any expansion', () => {
  const start = process.cpuUsage();
  const sequence = parseSequence(manifest({ frames: `${'a'.repeat(1000)}{0}.spz`, count: 1_000_000 }), 'a.json');
  assert.ok(JSON.stringify(sequence).length < 1_300);
  assert.equal(framePath(sequence, 999_999), `${'a'.repeat(1000)}999999.spz`);
  assert.ok(process.cpuUsage(start).user < 50_000);
});

test('every frame is shown for its time', () => {
  const sequence = parseSequence(manifest({ frames: '{0}.spz', count: 48 }), 'a.json');
  for (let k = 0; k < 48; k++) {
    assert.equal(frameAt(sequence, k / 24), k);
    assert.equal(frameAt(sequence, (k + 0.99) / 24), k);
  }
  assert.deepEqual([frameAt(sequence, -1), frameAt(sequence, 9), frameAt(sequence, NaN)], [0, 47, 0]);
});

test('manifests that say nothing sensible are refused by name', async () => {
  const cases: [Uint8Array, RegExp][] = [
    [manifest({ frames: [] }), /frames: expected 1 to 1,000,000 paths/],
    [manifest({ frames: 'a.spz', count: 3 }), /a path with \{0001\}/],
    [manifest({ frames: '{1}.spz', count: 1e9 }), /count: expected 1 to/],
    [manifest({ frames: `{${'0'.repeat(16)}}.spz`, count: 9 }), /frames: expected at most 15 digits/],
    [manifest({ frames: ['a.spz'], framesPerSecond: 0 }), /framesPerSecond/],
    [manifest({ frames: [`${'./'.repeat(2_000)}a.spz`] }), /frames: expected paths of at most 2,048 characters/],
    [manifest({ frames: `${'./'.repeat(2_000)}{1}.spz`, count: 9 }), /at most 2,048 characters/],
    [text({ gaussianSplatSequence: 2 }), /version 1/],
  ];
  for (const [bytes, message] of cases) assert.throws(() => parseSequence(bytes, 'a.json'), message);
  await expectRefusal(manifest({ frames: ['a.spz'] }), 'decode/unsupported', /parseSequence/, { name: 'a.json' });
});
