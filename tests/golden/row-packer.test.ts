/** Splats that WebAssembly packs are, to the byte, those of `packGaussians`. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { boundsOf, keepUsable, type GaussianCloud, type ShDegree } from '@gaussian-splat/core';
import { readPrefix, splatRanges } from '@gaussian-splat/formats';
import { packGaussians, type PackedGaussians } from '@gaussian-splat/renderer';
import {
  JoinedBlocks,
  packCloud,
  recentered,
  RowPacker,
  type PackableRows,
  type RowLayout,
  type SortedBlock,
} from '@gaussian-splat/renderer/tools';
import { someOf } from '../support/extent.js';
import { seededRandom, type Random } from '../support/random.js';

/** Compares scenes word by word; assert's own report of long arrays takes minutes. */
function assertSame(found: PackedGaussians, expected: PackedGaussians): void {
  for (const name of ['geometry', 'sh', 'chunks'] as const) {
    const [a, b] = [found[name], expected[name]].map((each) =>
      Buffer.from(each.buffer, each.byteOffset, each.byteLength),
    );
    assert.ok(a.equals(b), `${name}: ${a.length} and ${b.length} bytes`);
  }
  const none = { geometry: undefined, sh: undefined, chunks: undefined };
  assert.deepEqual({ ...found, ...none }, { ...expected, ...none });
}

interface Kind {
  readonly count?: number;
  readonly shDegree?: ShDegree;
  /** Size of the harmonics above the constant one. */
  readonly shine?: number;
  readonly away?: number;
  /** Step of the indices of splats that cannot be drawn. */
  readonly unusable?: number;
  readonly isFlat?: boolean;
}

function scene({ count = 50_000, shDegree = 3, shine = 0.1, away = 0, unusable = 0, isFlat }: Kind): GaussianCloud {
  const random = seededRandom(11);
  const some = (length: number, low: number, high: number): Float32Array =>
    Float32Array.from({ length }, () => random.uniform(low, high));
  const numbers = 3 * (shDegree + 1) ** 2;
  const positions = some(3 * count, -4, 4).map((x) => x + away);
  if (isFlat) for (let i = 0; i < count; i++) positions[3 * i + 1] = 0;
  const opacities = some(count, -0.1, 1.1);
  if (unusable) for (let i = 0; i < count; i += unusable) opacities[i] = NaN;
  return {
    ...{ count, shDegree, positions, opacities },
    origin: [0, 0, 0],
    scales: some(3 * count, 0, 0.2),
    rotations: some(4 * count, -1, 1),
    sh: some(numbers * count, -shine, shine),
    antialiased: false,
    droppedCount: 0,
  };
}

const KINDS: Readonly<Record<string, Kind>> = {
  'of every day': {},
  'with splats that cannot be drawn': { unusable: 7 },
  'far from its origin': { away: 1e6 },
  'that shines': { shine: 3 },
  'of degree 0': { shDegree: 0 },
  'of degree 1': { shDegree: 1 },
  'of degree 2': { shDegree: 2, shine: 0.3 },
  'that is flat': { isFlat: true },
  'that is flat, with splats that cannot be drawn': { isFlat: true, unusable: 500 },
  'of a block and a little': { count: 16_385 },
  'that is small': { count: 700 },
};

test('the code runs here', async () => {
  assert.ok(await RowPacker.open(1, { shDegree: 0, shPrecision: 'int8', moved: [0, 0, 0] }));
});

for (const [name, kind] of Object.entries(KINDS)) {
  test(`a cloud ${name}`, async () => {
    const whole = scene(kind);
    const expected = packGaussians(whole);
    assert.equal(expected.shPrecision, kind.shine === 3 ? 'float16' : 'int8');
    assertSame(await packCloud(whole), expected);
  });
}

/** Numbers at the edges of what a row may contain. */
const ODD = [
  ...[NaN, Infinity, -Infinity, 0, -0, 1e-38, 1e-45, 3e38, -3e38, 1e18, 1.1e18, 100, -100, 27.6310211, 27.7],
  ...[-27.63, -27.7, 88.8, -110, 0.5, -0.5, 65504, 65520, 1e-8],
];

interface Trial {
  readonly count: number;
  readonly degree: ShDegree;
  /** Order of the properties. */
  readonly order?: 'shuffled' | 'reversed';
  readonly away?: number;
  readonly odd?: number;
  readonly shine?: number;
}

/** Writes a PLY of random splats. */
function plyOf({ count, degree, order, away = 0, odd = 0, shine = 0.1 }: Trial, random: Random): Uint8Array {
  const rest = Array.from({ length: 3 * ((degree + 1) ** 2 - 1) }, (_, k) => `f_rest_${k}`);
  const names = [
    ...['x', 'y', 'z', 'nx', 'f_dc_0', 'f_dc_1', 'f_dc_2', ...rest, 'opacity'],
    ...['scale_0', 'scale_1', 'scale_2', 'rot_0', 'rot_1', 'rot_2', 'rot_3'],
  ];
  if (order === 'reversed') names.reverse();
  if (order === 'shuffled') names.sort(() => random.uniform(-1, 1));
  const properties = names.map((name) => `property float ${name}\n`).join('');
  const header = `ply\nformat binary_little_endian 1.0\nelement vertex ${count}\n${properties}end_header\n`;
  const rows = new Float32Array(count * names.length);
  for (let at = 0; at < rows.length; at++) {
    const name = names[at % names.length];
    const value = random.uniform(-2, 2);
    if (/^[xyz]$/.test(name)) rows[at] = 2 * value + away;
    else if (name.startsWith('scale')) rows[at] = 2 * value - 4;
    else rows[at] = name.startsWith('f_rest') ? shine * value : 3 * value;
    if (random.uniform(0, 1) < odd) rows[at] = ODD[Math.floor(random.uniform(0, ODD.length))];
  }
  return new Uint8Array(Buffer.concat([Buffer.from(header), new Uint8Array(rows.buffer)]));
}

/** The scene of a packer, whose blocks are handed on or joined. */
async function joined(packer: RowPacker, layout: RowLayout, droppedCount: number): Promise<JoinedBlocks> {
  const facts = { antialiased: false, filterVariance: undefined, origin: [0, 0, 0] as const, droppedCount };
  const blocks = new JoinedBlocks(layout, packer.count, facts);
  await packer.finish((block) => blocks.add(block));
  return blocks;
}

/** Packs the rows of a file, which arrive in random pieces. */
type Packing = (packer: RowPacker, bytes: Uint8Array, random: Random, rows: PackableRows) => Promise<void>;

const alone: Packing = async (packer, bytes, random) => {
  for (let at = 0; at < bytes.length;) {
    const size = 1 + Math.floor(random.uniform(0, 60_000));
    packer.push(bytes.subarray(at, at + size));
    at += size;
  }
};

/** Every second batch is packed by another packer, and placed later, the last one first. */
const helped =
  (layout: RowLayout): Packing =>
  async (packer, bytes, _, rows) => {
    const BATCH = 300;
    const late: (() => void)[] = [];
    const helper = (await RowPacker.open({ ...rows, count: BATCH }, layout))!;
    for (let row = 0; row < rows.count; row += BATCH) {
      const batch = bytes.slice(row * rows.byteLength, (row + BATCH) * rows.byteLength);
      if ((row / BATCH) % 2 || batch.length < BATCH * rows.byteLength) {
        packer.push(batch);
        continue;
      }
      const first = packer.reserve(BATCH);
      helper.push(batch);
      const count = helper.take(batch);
      late.push(() => packer.place(first, count, batch));
    }
    for (const place of late.reverse()) place();
  };

const TRIALS: readonly Trial[] = ([0, 1, 2, 3] as const).flatMap((degree) => [
  { count: 5000, degree },
  { count: 5000, degree, odd: 0.01 },
  { count: 1500, degree, order: 'shuffled', odd: 0.003 },
  { count: 700, degree, order: 'reversed', away: 1000 },
  { count: 20_000, degree, shine: 2 },
]);

for (const trial of someOf(TRIALS, 8)) {
  test(`rows: ${JSON.stringify(trial)}`, async () => {
    const random = seededRandom(TRIALS.indexOf(trial));
    const bytes = plyOf(trial, random);
    const { rows } = (await splatRanges(bytes, 'a.ply'))!;
    const cloud = (await readPrefix(bytes, { name: 'a.ply' }))!;
    const near = recentered(cloud);
    const moved = near.origin.map((x, axis) => x - cloud.origin[axis]) as unknown as RowLayout['moved'];
    const table = { count: trial.count, byteLength: rows!.byteLength, columns: rows!.columns! };
    for (const shPrecision of ['int8', 'float16'] as const) {
      const expected = packGaussians(cloud, { sh: shPrecision });
      const layout = { shDegree: trial.degree, shPrecision, moved };
      for (const pack of [alone, helped(layout)]) {
        const packer = (await RowPacker.open(table, layout))!;
        await pack(packer, bytes.subarray(rows!.start), random, table);
        packer.sort();
        assert.equal(packer.precisionFor(), packGaussians(cloud).shPrecision);
        assertSame((await joined(packer, layout, trial.count - packer.count)).packed, expected);
      }
    }
  });
}

async function packerOf(cloud: GaussianCloud): Promise<{ packer: RowPacker; layout: RowLayout }> {
  const layout: RowLayout = { shDegree: cloud.shDegree, shPrecision: 'int8', moved: [0, 0, 0] };
  const packer = (await RowPacker.open(cloud.count, layout))!;
  packer.pushCloud(cloud);
  packer.sort();
  return { packer, layout };
}

test('the bounds of joined blocks are those of the cloud', async () => {
  const kept = keepUsable(scene({}));
  const expected = boundsOf(kept);
  const { packer, layout } = await packerOf(kept);
  const bounds = (await joined(packer, layout, 0)).boundsFor();
  assert.deepEqual([bounds.min, bounds.max], [expected.min, expected.max]);
  assert.ok(Math.abs(bounds.radius - expected.radius) < 0.01 * expected.radius, `${bounds.radius}`);
});

test('a receiver that is late never has more than eight blocks, and its buffers are used again', async () => {
  const cloud = scene({ count: 11 * 16_384, shDegree: 0 });
  const { packer } = await packerOf(cloud);
  const expected = packGaussians(cloud);
  const found: PackedGaussians = { ...expected, geometry: new Uint32Array(expected.geometry.length) };
  const buffers = new Set<ArrayBufferLike>();
  const away: (() => void)[] = [];
  let max = 0;
  const finished = packer.finish((block: SortedBlock) => {
    buffers.add(block.geometry.buffer);
    return new Promise((resolve) => {
      max = Math.max(max, away.length + 1);
      away.push(() => {
        found.geometry.set(block.geometry, 8 * block.start);
        resolve(block);
      });
    });
  });
  let isDone = false;
  void finished.then(() => (isDone = true));
  while (!isDone) {
    await new Promise((resolve) => setTimeout(resolve));
    away.shift()?.();
  }
  assert.equal(max, 8);
  assert.equal(buffers.size, 8);
  assert.deepEqual(found.geometry, expected.geometry);
});

test('a receiver that gives up ends the sending', async () => {
  const { packer } = await packerOf(scene({ count: 11 * 16_384, shDegree: 0 }));
  await assert.rejects(
    packer.finish(() => Promise.reject(new Error('canceled'))),
    /canceled/,
  );
});
