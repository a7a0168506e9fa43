/**
 * Cut, damaged and random files: every one is read or refused with a named error, soon and with little memory.
 * SECURITY.md: "Scene and model files are untrusted data".
 */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import fc from 'fast-check';
import { isLab } from '../support/extent.js';
import { needsSharedData, sharedFile } from '../support/data.js';
import { assertHelpful, CUT_STEP, expectRefusal, refusalOf } from './support/expect.js';
import { writePly } from './support/ply-writer.js';
import { inriaColumns, rawSplats } from './support/splats.js';
import { spzBody, writeSpz } from './support/spz-writer.js';

const splats = rawSplats(5, 1);
const columns = inriaColumns(splats);
const compressedPly = writePly([
  {
    name: 'chunk',
    columns: ['min_', 'max_', 'min_scale_', 'max_scale_'].flatMap((bound, k) =>
      ['x', 'y', 'z'].map((axis) => ({ name: bound + axis, type: 'float' as const, values: [k - 3] })),
    ),
  },
  {
    name: 'vertex',
    columns: ['position', 'rotation', 'scale', 'color'].map((name) => ({
      name: `packed_${name}`,
      type: 'uint' as const,
      values: Array.from({ length: 5 }, (_, i) => (i * 0x9e3779b1) >>> 0),
    })),
  },
]);
const plainSplats = new Uint8Array(
  Buffer.concat(
    splats.positions.map((position, i) => {
      const floats = Float32Array.from([...position, ...splats.logScales[i].map(Math.exp)]);
      return Buffer.concat([Buffer.from(floats.buffer), Buffer.from([1, 2, 3, 255, 255, 128, 128, 128])]);
    }),
  ),
);

const FILES: Readonly<Record<string, Uint8Array>> = {
  'little.ply': writePly([{ name: 'vertex', columns }]),
  'big.ply': writePly([{ name: 'vertex', columns }], { encoding: 'binary_big_endian' }),
  'cr.ply': writePly([{ name: 'vertex', columns }], { newline: '\r' }),
  'lists.ply': writePly([
    {
      name: 'vertex',
      columns: [
        {
          name: 'ids',
          type: 'int',
          listCountType: 'ushort',
          values: splats.positions.map((_, i) => [i, i].slice(i % 3)),
        },
        ...columns,
      ],
    },
  ]),
  'compressed.ply': compressedPly,
  'plain.spz': spzBody(splats, { version: 2 }),
  'v1.spz': writeSpz(splats, { version: 1 }),
  'v3.spz': writeSpz(splats, { version: 3 }),
  'v4.spz': writeSpz(splats, { version: 4 }),
  'plain.splat': plainSplats,
};

for (const [name, file] of Object.entries(FILES)) {
  test(`${name}, whole, is read`, async () => assert.equal(await refusalOf(file, { name }), undefined));

  test(`${name}, cut anywhere, is refused by name`, async () => {
    for (let length = 0; length < file.length; length += CUT_STEP) {
      const error = await refusalOf(file.subarray(0, length), { name });
      const isWholeRecord = name.endsWith('.splat') && length > 0 && length % 32 === 0;
      if (isWholeRecord) continue;
      assert.ok(error, `${length} of ${file.length} bytes were read`);
      assertHelpful(error, name);
      const codes = ['decode/truncated', 'decode/unknown-format', 'decode/empty', 'decode/corrupt'];
      assert.ok(codes.includes(error.code), `${length} bytes: ${error.message}`);
      if (length > 64 && !name.endsWith('.spz')) assert.equal(error.code, 'decode/truncated', `${length} bytes`);
    }
  });

  test(`${name}, with bytes changed, is read or refused by name`, async () => {
    const change = fc.tuple(fc.nat(file.length - 1), fc.nat(255));
    await fc.assert(
      fc.asyncProperty(fc.array(change, { minLength: 1, maxLength: 6 }), async (changes) => {
        const damaged = Uint8Array.from(file);
        for (const [at, value] of changes) damaged[at] = value;
        const error = await refusalOf(damaged, { name });
        if (error) assertHelpful(error, name);
      }),
      { numRuns: isLab ? 300 : 100 },
    );
  });
}

test('an ASCII PLY cut before its last value is refused', async () => {
  const file = writePly([{ name: 'vertex', columns: inriaColumns(rawSplats(4, 0)) }], { encoding: 'ascii' });
  const lastValue = Buffer.from(file).lastIndexOf(' ');
  for (let length = 0; length <= lastValue; length++) {
    const error = await refusalOf(file.subarray(0, length), { name: 'a.ply' });
    assert.ok(error, `${length} of ${file.length} bytes were read`);
    assertHelpful(error, 'a.ply');
  }
});

test('random bytes are read or refused by name, under any file name', async () => {
  const start = fc.constantFrom(
    '',
    'ply\n',
    'ply\nformat ascii 1.0\n',
    'NGSP',
    'NGSP\x04\0\0\0',
    '\x1f\x8b\x08',
    '{"',
    '<',
    'PK',
  );
  const name = fc.constantFrom('a.ply', 'a.compressed.ply', 'a.spz', 'a.splat', 'a');
  await fc.assert(
    fc.asyncProperty(start, fc.uint8Array({ maxLength: 300 }), name, async (prefix, rest, name) => {
      const bytes = new Uint8Array(Buffer.concat([Buffer.from(prefix, 'latin1'), rest]));
      const error = await refusalOf(bytes, { name });
      if (error) assertHelpful(error, name);
    }),
    { numRuns: isLab ? 2000 : 500 },
  );
});

test('random headers of PLY files are read or refused by name', async () => {
  const word = fc.constantFrom(
    'element',
    'property',
    'comment',
    'list',
    'float',
    'uchar',
    'int',
    'vertex',
    'x',
    '0',
    '3',
    '9e9',
    '-1',
    '',
  );
  const line = fc.array(word, { maxLength: 5 }).map((words) => words.join(' '));
  await fc.assert(
    fc.asyncProperty(fc.array(line, { maxLength: 12 }), fc.uint8Array({ maxLength: 64 }), async (lines, data) => {
      const header = ['ply', 'format binary_little_endian 1.0', ...lines, 'end_header', ''].join('\n');
      const error = await refusalOf(new Uint8Array(Buffer.concat([Buffer.from(header), data])), { name: 'a.ply' });
      assert.ok(error);
      assertHelpful(error, 'a.ply');
    }),
    { numRuns: isLab ? 1000 : 300 },
  );
});

test('a header without an end is given up', async () => {
  const endless = new Uint8Array(Buffer.from(`ply\nformat ascii 1.0\n${'comment more\n'.repeat(100_000)}`));
  const error = await refusalOf(endless, { name: 'a.ply' });
  assert.equal(error?.code, 'decode/header');
  assert.match(error.message, /none in the first 262,144 bytes/);
});

test('real files cut at random are refused by name', { skip: needsSharedData }, async () => {
  for (const name of [
    'formats/playbot3.ply',
    'formats/playbot3.compressed.ply',
    'formats/playbot3.niantic-v2.spz',
    'formats/playbot3.niantic-v4.spz',
  ]) {
    const file = sharedFile(name);
    for (const share of [0.001, 0.01, 0.3, 0.5, 0.9, 0.999]) {
      const error = await refusalOf(file.subarray(0, Math.floor(share * file.length)), { name });
      assert.equal(error?.code, 'decode/truncated', `${name} at ${share}: ${error?.message}`);
      assertHelpful(error, name);
    }
  }
});

test('real compressed files with damaged bytes are read or refused by name', { skip: needsSharedData }, async () => {
  for (const name of ['formats/playbot3.niantic-v3.spz', 'formats/playbot3.niantic-v4.spz']) {
    const file = sharedFile(name);
    let refused = 0;
    for (let k = 0; k < 20; k++) {
      const damaged = Uint8Array.from(file);
      damaged[Math.floor(((k + 0.5) / 20) * file.length)] ^= 1 << (k % 8);
      const error = await refusalOf(damaged, { name });
      if (!error) continue;
      refused++;
      assert.ok(['decode/corrupt', 'decode/truncated', 'decode/header'].includes(error.code), error.message);
      assertHelpful(error, name);
    }
    // gzip has a checksum; the zstd streams of SPZ have none, so that a changed literal may pass.
    assert.ok(name.includes('v3') ? refused === 20 : refused > 0, `${refused} of 20 refused`);
  }
});

test('lists within lists within lists, where a description has something else, are refused by name', async () => {
  const deep = '['.repeat(200_000) + ']'.repeat(200_000);
  const descriptions: Readonly<Record<string, string>> = {
    'lod-meta.json': `{"lodLevels":1,"filenames":["a"],"tree":${deep}}`,
    'meta.json': `{"means":${deep}}`,
    'a.gltf': `{"asset":{"version":${deep}}}`,
  };
  for (const [name, text] of Object.entries(descriptions)) {
    const error = await refusalOf(new TextEncoder().encode(text), { name });
    assert.ok(error);
    assertHelpful(error, name);
  }
});

test('texts whose patterns could be matched in countless ways are read or refused at once', async () => {
  const start = process.cpuUsage();
  await expectRefusal(Buffer.from(`${'<!---->'.repeat(140)}x`), 'decode/unknown-format', /a text: "<!---->/);
  const spaces = '\xa0'.repeat(200_000);
  for (const comment of [
    `sortmethod${spaces}a b`,
    `antialiased${spaces}a b`,
    `filter_variance${spaces}a b`,
    `vertical axis:${spaces}\r.`,
    `vertical axis: ${'1,'.repeat(100_000)}`,
  ]) {
    const file = writePly([{ name: 'vertex', columns }], { headerLines: [`comment ${comment}`] });
    assert.equal(await refusalOf(file, { name: 'a.ply' }), undefined, comment.slice(0, 20));
  }
  const openFile = async (): Promise<Uint8Array> => Buffer.from('{"asset":{"version":"2.0"}}');
  for (const [length, sentence] of [
    [2_000, /1 tiles without/],
    [200_000, /addresses of at most 2,048 characters/],
  ] as const) {
    const uri = `${'a'.repeat(length)}/b.glb`;
    const tileset = { asset: { version: '1.1' }, geometricError: 1, root: { content: { uri } } };
    const error = await refusalOf(Buffer.from(JSON.stringify(tileset)), { name: 'tileset.json', openFile });
    assert.match(error?.message ?? '', sentence);
  }
  const { user } = process.cpuUsage(start);
  assert.ok(user < 2e6, `${user / 1e6} s`);
});
