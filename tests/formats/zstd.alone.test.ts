/** The zstd decoder through the door that people use: as a stream of an SPZ file of version 4. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import fc from 'fast-check';
import { readScene } from '@gaussian-splat/formats';
import { isLab } from '../support/extent.js';
import { assertSameNumbers, expectRefusal, refusalOf } from './support/expect.js';
import { headerOf, spzContainer, storeZstd } from './support/spz-writer.js';
import { rawSplats } from './support/splats.js';
import { zstdContents, zstdFixtures } from './support/zstd-fixtures.js';

/** An SPZ file whose opacities are `compressed`, announced as `count` bytes; the other attributes are plain. */
function sceneOfOpacities(compressed: Uint8Array, count: number): Uint8Array {
  const zeros = (size: number) => new Uint8Array(size * count);
  const uncompressed = [zeros(9), zeros(1), zeros(3), zeros(3).fill(128), zeros(4)];
  const streams = uncompressed.map((stream, k) => (k === 1 ? compressed : storeZstd(stream)));
  return spzContainer(headerOf({ ...rawSplats(0, 0), count }, { version: 4 }, 5), streams, uncompressed);
}

async function decompress(compressed: Uint8Array, length: number): Promise<Uint8Array> {
  const { opacities } = await readScene(sceneOfOpacities(compressed, length));
  return Uint8Array.from(opacities, (opacity) => Math.round(255 * opacity));
}

for (const { content, options, base64 } of zstdFixtures) {
  test(`${content}, compressed with ${options}`, async () => {
    const expected = zstdContents[content]();
    assertSameNumbers(await decompress(new Uint8Array(Buffer.from(base64, 'base64')), expected.length), expected);
  });
}

test('several frames and skippable ones are one content', async () => {
  const frames = zstdFixtures.filter(({ content }) => content === 'noise' || content === 'words');
  const skippable = Uint8Array.of(0x53, 0x2a, 0x4d, 0x18, 3, 0, 0, 0, 9, 9, 9);
  const parts = frames.flatMap(({ base64 }) => [skippable, Buffer.from(base64, 'base64')]);
  const expected = new Uint8Array(Buffer.concat(frames.map(({ content }) => zstdContents[content]())));
  assertSameNumbers(await decompress(new Uint8Array(Buffer.concat(parts)), expected.length), expected);
});

test('a stream cut anywhere is refused', async () => {
  const { base64, content } = zstdFixtures.find(({ content }) => content === 'skewed')!;
  const stream = new Uint8Array(Buffer.from(base64, 'base64'));
  const length = zstdContents[content]().length;
  for (let cut = 0; cut < stream.length; cut++) {
    const file = sceneOfOpacities(stream.subarray(0, cut), length);
    await expectRefusal(file, 'decode/truncated', /file, byte [\d,]+, zstd stream of opacities: expected an intact/);
  }
});

test('a stream of another length than announced is refused', async () => {
  const stored = storeZstd(new Uint8Array(500));
  await expectRefusal(sceneOfOpacities(stored, 499), 'decode/corrupt', /a frame of 500 bytes where 499 belong/);
  await expectRefusal(sceneOfOpacities(stored, 501), 'decode/truncated', /500 bytes of content instead of 501/);
});

test('damaged streams are read or refused, never worse', async () => {
  const samples = zstdFixtures.filter(({ content }) => content !== 'repeats' && content !== 'long');
  await fc.assert(
    fc.asyncProperty(
      fc.constantFrom(...samples),
      fc.array(fc.tuple(fc.nat(), fc.nat(255)), { minLength: 1, maxLength: 8 }),
      async ({ content, base64 }, changes) => {
        const stream = new Uint8Array(Buffer.from(base64, 'base64'));
        for (const [at, value] of changes) stream[at % stream.length] = value;
        const error = await refusalOf(sceneOfOpacities(stream, zstdContents[content]().length));
        if (error) assert.ok(['decode/corrupt', 'decode/truncated'].includes(error.code), error.message);
      },
    ),
    { numRuns: isLab ? 2000 : 500 },
  );
});

/** A frame of `length` bytes of content that one compressed block is to give. */
function frameOf(length: number, block: readonly number[] | Uint8Array): Uint8Array {
  const header = (block.length << 3) | (2 << 1) | 1;
  const size = [length & 255, (length >> 8) & 255, (length >> 16) & 255, 0];
  const start = [0x28, 0xb5, 0x2f, 0xfd, 0xa0, ...size, header & 255, (header >> 8) & 255, header >> 16];
  return new Uint8Array(Buffer.concat([Buffer.from(start), Buffer.from(block)]));
}

/** Literals as they are, then one sequence in codes that take no bits themselves; `bits` are those of its values. */
function oneSequence(
  literals: string,
  codes: { literal: number; offset: number; match: number },
  bits: number,
): number[] {
  return [literals.length << 3, ...Buffer.from(literals), 1, 0x54, codes.literal, codes.offset, codes.match, bits];
}

test('a match repeats existing output, and cannot begin before it', async () => {
  // Offset value 1 is the last offset, which is 1 at the start of a frame.
  const repeat = frameOf(4, oneSequence('A', { literal: 1, offset: 0, match: 0 }, 0b1));
  assertSameNumbers(await decompress(repeat, 4), Buffer.from('AAAA'));
  // Offset code 2 with bits 01 is value 5, which is offset 2: one byte before the content.
  const before = frameOf(4, oneSequence('A', { literal: 1, offset: 2, match: 0 }, 0b101));
  await expectRefusal(sceneOfOpacities(before, 4), 'decode/corrupt', /a match that begins before the content/);
  const unread = frameOf(4, oneSequence('A', { literal: 1, offset: 0, match: 0 }, 0b10));
  await expectRefusal(sceneOfOpacities(unread, 4), 'decode/corrupt', /bits left over/);
});

test('a new frame forgets the offsets and the content of the one before', async () => {
  const first = frameOf(5, oneSequence('AB', { literal: 2, offset: 2, match: 0 }, 0b101));
  const second = frameOf(4, oneSequence('C', { literal: 1, offset: 0, match: 0 }, 0b1));
  const both = new Uint8Array(Buffer.concat([first, second]));
  assertSameNumbers(await decompress(both, 9), Buffer.from('ABABACCCC'));
  const backwards = frameOf(4, oneSequence('C', { literal: 1, offset: 2, match: 0 }, 0b101));
  const across = new Uint8Array(Buffer.concat([first, backwards]));
  await expectRefusal(sceneOfOpacities(across, 9), 'decode/corrupt', /a match that begins before the content/);
});

test('literals that do not use up their bits are refused', async () => {
  const { base64, content } = zstdFixtures.find(({ content }) => content === 'numbers')!;
  const stream = new Uint8Array(Buffer.from(base64, 'base64'));
  // 7 bytes of frame header, 3 of the block's, 3 of the literals', 9 of the prefix code: then the sizes of the streams.
  for (const change of [-1, 1]) {
    const damaged = Uint8Array.from(stream);
    damaged[22] += change;
    const file = sceneOfOpacities(damaged, zstdContents[content]().length);
    await expectRefusal(file, 'decode/corrupt', /literals of another length than announced/);
  }
});

test('a few bytes that announce billions of copied bytes are refused at once', async () => {
  // No literals, 98,303 sequences, each a match of 65,539 bytes or more, in codes that take no bits.
  const short = frameOf(65_791, [0x00, 255, 0xff, 0xff, 0x54, 0, 0, 52, 0x01]);
  // 60,000 literals in one byte, as many sequences of a literal and a match, and all the bits that they need.
  const [literals, sequences] = [60_000, 60_000];
  const bits = new Uint8Array(2 * sequences + 1);
  bits[2 * sequences] = 1;
  const header = (literals << 4) | (3 << 2) | 1;
  const counted = sequences - 0x7f00;
  const long = [
    ...[header & 255, (header >> 8) & 255, header >> 16, 65],
    ...[255, counted & 255, counted >> 8, 0x54, 1, 0, 52],
    ...bits,
  ];
  for (const [bomb, message] of [
    [short, /a match that begins before|more bits than there are/],
    [frameOf(65_791, long), /more content than announced/],
  ] as const) {
    const start = process.cpuUsage();
    await expectRefusal(sceneOfOpacities(bomb, 65_791), 'decode/corrupt', message);
    assert.ok(process.cpuUsage(start).user < 1e6, 'refused within a second of work');
  }
});

test('a frame that needs a dictionary is refused', async () => {
  const frame = Uint8Array.of(0x28, 0xb5, 0x2f, 0xfd, 0x21, 7, 4, 0x21, 0, 0, 1, 2, 3, 4);
  await expectRefusal(sceneOfOpacities(frame, 4), 'decode/corrupt', /needs a dictionary/);
});
