import assert from 'node:assert/strict';
import { test } from 'node:test';
import { readScene } from '@gaussian-splat/formats';
import { needsSharedData, sharedFile } from '../support/data.js';
import { assertAtMost, assertSameCloud, coefficient, expectRefusal, largestDifference } from './support/expect.js';
import { BOUNDS, COLOR_BOUNDS, compressed } from './support/compressed-ply.js';
import { writePly, type PlyWriterElement } from './support/ply-writer.js';

const AXES = ['x', 'y', 'z'];

const near = (a: ArrayLike<number>, b: ArrayLike<number>, tolerance = 1e-6) =>
  assertAtMost(largestDifference(a, b), tolerance, `${Array.from(a)} is not ${Array.from(b)}`);

test('positions and scales: 11, 10 and 11 bits between the bounds of the chunk', async () => {
  const [low, high, middle] = [0, 0xffffffff, ((1024 << 21) | (512 << 11) | 1024) >>> 0];
  const splats = [low, high, middle].map((word) => ({ position: word, scale: word }));
  const cloud = await readScene(writePly(compressed(splats)));
  const half = [1024 / 2047, 512 / 1023, 1024 / 2047];
  const at = (t: readonly number[], kind: string) =>
    AXES.map((axis, k) => BOUNDS[`min_${kind}${axis}`] * (1 - t[k]) + BOUNDS[`max_${kind}${axis}`] * t[k]);
  near(cloud.positions, [...at([0, 0, 0], ''), ...at([1, 1, 1], ''), ...at(half, '')]);
  near(cloud.scales, [...at([0, 0, 0], 'scale_'), ...at([1, 1, 1], 'scale_'), ...at(half, 'scale_')].map(Math.exp));
});

test('rotations: the two highest bits name the component of (w, x, y, z) that is left out', async () => {
  // Fractions of 1023 that mean 0, 1/2 and -1/2 as nearly as 10 bits can.
  const word = (largest: number, a: number, b: number, c: number) =>
    ((largest << 30) | (a << 20) | (b << 10) | c) >>> 0;
  const value = (bits: number) => (bits / 1023 - 0.5) * Math.SQRT2;
  const [zero, plus, minus] = [511, 873, 150];
  const splats = [0, 1, 2, 3].map((largest) => ({ rotation: word(largest, zero, plus, minus) }));
  const { rotations } = await readScene(writePly(compressed(splats)));
  const rest = [value(zero), value(plus), value(minus)];
  const largest = Math.sqrt(1 - rest.reduce((sum, v) => sum + v * v, 0));
  near(
    rotations,
    [0, 1, 2, 3].flatMap((k) => [...rest.slice(0, k), largest, ...rest.slice(k)]),
    1e-6,
  );
});

test('colors: plain 0..1 with 12 chunk properties, between the bounds with 18; opacity 255 is 1', async () => {
  const splats = [{ color: 0xff8000ff }, { color: 0x00000000 }];
  const plain = await readScene(writePly(compressed(splats)));
  const colors = (sh: Float32Array) => Array.from(sh, (v) => 0.5 + 0.28209479177387814 * v);
  near(colors(plain.sh), [1, 128 / 255, 0, 0, 0, 0]);
  assert.deepEqual([...plain.opacities], [1, 0]);
  const bounded = await readScene(writePly(compressed(splats, { ...BOUNDS, ...COLOR_BOUNDS })));
  near(colors(bounded.sh), [1, (2 * 128) / 255, 0.25, -1, 0, 0.25]);
});

for (const [restCount, degree] of [
  [9, 1],
  [24, 2],
  [45, 3],
]) {
  test(`spherical harmonics of degree ${degree}: channel after channel in the file, side by side in the cloud`, async () => {
    const rest = Array.from({ length: restCount }, (_, k) => (k === 0 ? 0 : k === 1 ? 255 : 3 * k));
    const cloud = await readScene(writePly(compressed([{ rest }, { rest: [...rest].reverse() }])));
    assert.equal(cloud.shDegree, degree);
    const meaning = (byte: number) => 8 * ((byte === 0 ? 0 : byte === 255 ? 1 : (byte + 0.5) / 256) - 0.5);
    for (let k = 0; k < restCount / 3; k++) {
      const channels = [k, k + restCount / 3, k + (2 * restCount) / 3];
      const reversed = channels.map((c) => rest[restCount - 1 - c]);
      near(coefficient(cloud, k + 1), [...channels.map((c) => meaning(rest[c])), ...reversed.map(meaning)]);
    }
  });
}

test('every 256 splats have bounds of their own', async () => {
  const elements = compressed(Array(257).fill({ position: 0 }), BOUNDS, 2);
  const minX = elements[0].columns.find(({ name }) => name === 'min_x');
  (minX?.values as number[])[1] = 1.5;
  const { positions } = await readScene(writePly(elements));
  assert.equal(positions[3 * 255], -2);
  assert.equal(positions[3 * 256], 1.5);
});

test('all encodings of PLY are read', async () => {
  const elements = compressed([{ position: 123456789, color: 0x12345678, rest: Array(9).fill(7) }]);
  const clouds = [];
  for (const encoding of ['binary_little_endian', 'binary_big_endian', 'ascii'] as const) {
    clouds.push(await readScene(writePly(elements, { encoding })));
  }
  assertSameCloud(clouds[1], clouds[0]);
  assertSameCloud(clouds[2], clouds[0]);
});

test('headers that contradict themselves are refused', async () => {
  const splat = { rest: Array(9).fill(128) };
  const without = (element: number, property: string) =>
    compressed([splat]).map((e, k) =>
      k === element ? { ...e, columns: e.columns.filter((c) => c.name !== property) } : e,
    );
  const cases: [PlyWriterElement[], RegExp][] = [
    [compressed(Array(257).fill(splat)), /element "chunk": expected 2 rows.*found 1/],
    [compressed([splat], BOUNDS, 2), /element "chunk": expected 1 rows.*found 2/],
    [compressed([splat]).slice(1), /an element "chunk"/],
    [without(0, 'max_scale_z'), /element "chunk".*max_scale_z/],
    [without(1, 'packed_scale'), /element "vertex".*packed_scale/],
    [without(2, 'f_rest_8'), /0, 9, 24, 45 or 72 properties/],
    [
      compressed([splat, splat]).map((e) => (e.name === 'sh' ? { ...e, count: 1 } : e)),
      /element "sh": expected 2 rows/,
    ],
    [compressed([splat], { ...BOUNDS, min_r: 0 }), /element "chunk".*min_g/],
  ];
  for (const [elements, message] of cases) await expectRefusal(writePly(elements), 'decode/header', message);
  const huge = compressed([splat]).map((e) => ({ ...e, count: e.name === 'chunk' ? 2 ** 24 : 2 ** 32 }));
  await expectRefusal(writePly(huge), 'decode/truncated', /16,777,216 rows of element "chunk"/);
});

test('the 2,730 opacities of 255 in a captured file are 1', { skip: needsSharedData }, async () => {
  const cloud = await readScene(sharedFile('scenes/angel.compressed.ply'));
  assert.deepEqual([cloud.count, cloud.droppedCount], [71_377, 0]);
  assert.equal(cloud.opacities.filter((opacity) => opacity === 1).length, 2730);
});

test('any length of comments before the properties leaves it what it is', async () => {
  const splats = [{ position: 5, rotation: 7, scale: 9, color: 0x80808080 }];
  const headerLines = new Array<string>(400).fill(`comment ${'x'.repeat(100)}`);
  const plain = await readScene(writePly(compressed(splats)), { name: 'a.ply' });
  assertSameCloud(await readScene(writePly(compressed(splats), { headerLines }), { name: 'a.ply' }), plain);
});
