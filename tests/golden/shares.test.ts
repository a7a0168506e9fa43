/** Scenes that several threads pack are, to the byte, what one thread makes of them. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { boundsOf, keepUsable, type GaussianCloud, type ShDegree } from '@gaussian-splat/core';
import { packGaussians, type PackedGaussians } from '@gaussian-splat/renderer';
import {
  JoinedBlocks,
  layoutOf,
  packShard,
  SHARD_SPLATS,
  ShareCells,
  sortBlock,
  type ShareLayout,
} from '@gaussian-splat/renderer/tools';
import { seededRandom } from '../support/random.js';

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

/** Splats `first` to `end`, in arrays of their own. */
function part(cloud: GaussianCloud, first: number, end: number): GaussianCloud {
  const numbers = 3 * (cloud.shDegree + 1) ** 2;
  return {
    ...cloud,
    count: end - first,
    positions: cloud.positions.slice(3 * first, 3 * end),
    scales: cloud.scales.slice(3 * first, 3 * end),
    rotations: cloud.rotations.slice(4 * first, 4 * end),
    opacities: cloud.opacities.slice(first, end),
    sh: cloud.sh.slice(numbers * first, numbers * end),
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
  'of one share and a little': { count: SHARD_SPLATS + 1 },
  'that is small': { count: 700 },
};

const partsOf = (whole: GaussianCloud): GaussianCloud[] => {
  const parts = [];
  for (let first = 0; first < whole.count; first += SHARD_SPLATS)
    parts.push(keepUsable(part(whole, first, Math.min(whole.count, first + SHARD_SPLATS))));
  return parts;
};

/** Packs parts by a layout, and by another if the scene asks for it. */
function joined(parts: readonly GaussianCloud[], layout: ShareLayout, rows: number): JoinedBlocks {
  const cells = new ShareCells(layout);
  const shares = parts.map((cloud) => packShard(cloud, layout));
  for (const share of shares) cells.add(share);
  const needed = cells.layoutFor();
  if (needed !== layout) return joined(parts, needed, rows);
  const count = shares.reduce((sum, share) => sum + share.count, 0);
  const { antialiased, origin } = parts[0];
  const facts = { antialiased, filterVariance: undefined, origin, droppedCount: rows - count };
  const blocks = new JoinedBlocks(layout, count, facts);
  for (const cell of cells.all().reverse()) blocks.add(sortBlock(cell.block()));
  return blocks;
}

for (const [name, kind] of Object.entries(KINDS)) {
  test(`a scene ${name}`, () => {
    const whole = scene(kind);
    const kept = keepUsable(part(whole, 0, whole.count));
    const expected = packGaussians(kept);
    const { packed, bounds: found } = joined(partsOf(whole), layoutOf(kept, 'int8'), whole.count);
    assert.equal(expected.shPrecision, kind.shine === 3 ? 'float16' : 'int8');
    assert.deepEqual(packed, expected);
    const bounds = boundsOf(kept);
    assert.deepEqual([found.min, found.max], kind.away ? [found.min, found.max] : [bounds.min, bounds.max]);
    assert.ok(Math.abs(found.radius - bounds.radius) < 0.01 * bounds.radius, `${found.radius}, ${bounds.radius}`);
  });
}

/** Mean extent of the chunks. */
const reachOfChunks = ({ chunks, count }: PackedGaussians): number => {
  let sum = 0;
  for (let at = 0; at < chunks.length; at += 8)
    sum += Math.hypot(...[0, 1, 2].map((axis) => chunks[at + 4 + axis] - chunks[at + axis]));
  return sum / Math.ceil(count / 256);
};

const sorted = ({ geometry }: PackedGaussians): Float64Array => {
  const sums = new Float64Array(geometry.length / 8);
  for (let i = 0; i < geometry.length; i++) sums[i >> 3] += geometry[i] * (1 + (i % 8));
  return sums.sort();
};

test('a layout by the first shard of a file in spatial order keeps neighbors together', () => {
  const shuffled = scene({ count: 100_000, shDegree: 0 });
  const order = Array.from({ length: shuffled.count }, (_, i) => i).sort(
    (a, b) => shuffled.positions[3 * a] - shuffled.positions[3 * b],
  );
  const pick = (values: Float32Array, size: number): Float32Array =>
    Float32Array.from({ length: values.length }, (_, i) => values[size * order[Math.floor(i / size)] + (i % size)]);
  const whole = {
    ...shuffled,
    positions: pick(shuffled.positions, 3),
    scales: pick(shuffled.scales, 3),
    rotations: pick(shuffled.rotations, 4),
    opacities: pick(shuffled.opacities, 1),
    sh: pick(shuffled.sh, 3),
  };
  const parts = partsOf(whole);
  const expected = packGaussians(keepUsable(part(whole, 0, whole.count)));
  const { packed } = joined(parts, layoutOf(parts[0], 'int8'), whole.count);
  assert.deepEqual(sorted(packed), sorted(expected), 'the same splats');
  const [found, best] = [packed, expected].map(reachOfChunks);
  console.log(`mean diagonal of a chunk ${found.toFixed(3)}, by the whole scene ${best.toFixed(3)}`);
  assert.ok(found < 1.25 * best, `${found}, ${best}`);
});

test('a scene whose end lies in planes keeps the order of its file', () => {
  const whole = scene({ count: 4 * SHARD_SPLATS });
  for (let i = SHARD_SPLATS; i < whole.count; i++) whole.positions[3 * i + 1] = i % 8;
  const parts = partsOf(whole);
  const kept = keepUsable(part(whole, 0, whole.count));
  const { packed } = joined(parts, layoutOf(parts[0], 'int8'), whole.count);
  assert.deepEqual(packed, packGaussians(kept));
});
