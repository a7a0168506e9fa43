/** Scenes that several threads pack are, to the byte, what one thread makes of them. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { boundsOf, keepUsable, type GaussianCloud, type ShDegree } from '@gaussian-splat/core';
import { packGaussians } from '@gaussian-splat/renderer';
import { joinShares, packShare, SHARE_SPLATS } from '@gaussian-splat/renderer/tools';
import { seededRandom } from '../support/random.js';

interface Kind {
  readonly count?: number;
  readonly shDegree?: ShDegree;
  /** Size of the harmonics above the constant one. */
  readonly shine?: number;
  readonly away?: number;
  /** Every so many-th splat cannot be drawn. */
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
  'of one share and a little': { count: SHARE_SPLATS + 1 },
  'that is small': { count: 700 },
};

for (const [name, kind] of Object.entries(KINDS)) {
  test(`a scene ${name}`, () => {
    const whole = scene(kind);
    const parts = [];
    for (let first = 0; first < whole.count; first += SHARE_SPLATS)
      parts.push(keepUsable(part(whole, first, Math.min(whole.count, first + SHARE_SPLATS))));
    const kept = keepUsable(part(whole, 0, whole.count));
    const expected = packGaussians(kept);
    const facts = { ...whole, droppedCount: kept.droppedCount };
    let joined = joinShares(
      parts.map((cloud) => packShare(cloud, 'int8')),
      {},
      facts,
    );
    if (typeof joined === 'string') {
      assert.equal(joined, expected.shPrecision);
      const precision = joined;
      joined = joinShares(
        parts.map((cloud) => packShare(cloud, precision)),
        {},
        facts,
      );
    }
    assert.ok(typeof joined !== 'string');
    assert.equal(expected.shPrecision, kind.shine === 3 ? 'float16' : 'int8');
    assert.deepEqual(joined.packed, expected);
    const { positions, opacities } = joined;
    const bounds = boundsOf({ count: opacities.length, positions, opacities, origin: whole.origin });
    assert.deepEqual(bounds, boundsOf(kept));
  });
}
