/** Levels of detail as they are built: how many, how they nest, and that merging keeps its invariants. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { packGaussians, type PackedGaussians } from '@gaussian-splat/renderer';
import { packedOrder, packWithDetail } from '@gaussian-splat/renderer/tools';
import { buildLevels, constants, DETAIL_NUMBERS, DETAIL_PLACES } from '@gaussian-splat/renderer/stages';
import { levelStarts } from '../support/detail-twin.js';
import { pebbles } from '../support/scenes/pebbles.js';

const { CULL_GROUP } = constants;
const cloud = pebbles(20_100);
const order = packedOrder(cloud);

test('each level has a quarter of the splats, down to one chunk; all together 4/3', () => {
  const levels = buildLevels(cloud, order);
  levels.slice(1).forEach(({ count }, k) => assert.equal(count, Math.ceil(levels[k].count / 4)));
  assert.ok(levels.at(-1)!.count <= CULL_GROUP && levels.at(-2)!.count > CULL_GROUP);
  const packed = packWithDetail(cloud);
  assert.equal(packed.leafCount, cloud.count);
  assert.ok(packed.count < 1.36 * cloud.count + CULL_GROUP * levels.length, `${packed.count} splats`);
});

test('a cloud of one chunk has no levels', () => {
  const packed = packWithDetail(pebbles(200));
  assert.equal(packed.details, undefined);
  assert.equal(packed.count, 200);
});

test('the finest level is what is packed without levels, byte for byte', () => {
  const [plain, packed] = [packGaussians(cloud), packWithDetail(cloud)];
  assert.deepEqual(packed.geometry.subarray(0, plain.geometry.length), plain.geometry);
  assert.deepEqual(packed.sh.subarray(0, plain.sh.length), plain.sh);
  assert.deepEqual(packed.chunks.subarray(0, plain.chunks.length), plain.chunks);
});

test('errors and spheres of a chunk exceed those of what it stands for, and each row knows those of the chunk above', () => {
  const packed = packWithDetail(cloud);
  const starts = levelStarts(packed);
  const rows = packed.details!;
  const at = (chunk: number, place: number, length = 1): number[] =>
    Array.from(rows.subarray(DETAIL_NUMBERS * chunk + place, DETAIL_NUMBERS * chunk + place + length));
  for (let level = 0; level + 1 < starts.length; level++) {
    for (let chunk = starts[level]; chunk < starts[level + 1]; chunk++) {
      const [error] = at(chunk, DETAIL_PLACES.error);
      assert.ok(level === 0 ? error === 0 : error > 0);
      const parent = starts[level + 1] + ((chunk - starts[level]) >> 2);
      if (level + 2 === starts.length) {
        assert.ok(at(chunk, DETAIL_PLACES.parentError)[0] >= 1e20, 'nothing stands for the coarsest chunk');
        continue;
      }
      assert.deepEqual(at(chunk, DETAIL_PLACES.parentError), at(parent, DETAIL_PLACES.error));
      assert.deepEqual(at(chunk, DETAIL_PLACES.parentSphere, 4), at(parent, DETAIL_PLACES.sphere, 4));
      assert.ok(at(parent, DETAIL_PLACES.error)[0] > error);
      const [x, y, z, radius] = at(chunk, DETAIL_PLACES.sphere, 4);
      const [px, py, pz, around] = at(parent, DETAIL_PLACES.sphere, 4);
      assert.ok(Math.hypot(px - x, py - y, pz - z) + radius < around);
    }
  }
});

test('merging keeps mean color and middle, by what splats weigh, and covariances stay covariances', () => {
  const levels = buildLevels(cloud, order);
  const means = levels.slice(0, 3).map((level) => weightedMeans(level));
  for (const mean of means.slice(1)) {
    // The weight of a merged splat is its covered area, a little less than its overlapping parts have: not exactly the
    // same mean. The scene is 12 wide.
    mean.forEach((value, k) =>
      assert.ok(Math.abs(value - means[0][k]) < (k < 3 ? 0.3 : 0.05), `${k}: ${value}, ${means[0][k]}`),
    );
  }
  for (const { factors, opacities } of levels) {
    assert.ok(factors.every(Number.isFinite));
    assert.ok(opacities.every((opacity) => opacity >= 0 && opacity <= Math.E));
  }
});

/** Means of position and of the first harmonics, weighted by opacity times area. */
function weightedMeans({
  count,
  positions,
  factors,
  opacities,
  sh,
  shOrder,
}: ReturnType<typeof buildLevels>[0]): number[] {
  const sums = new Float64Array(7);
  for (let i = 0; i < count; i++) {
    const [xx, , yy, , , zz] = factors.subarray(6 * i, 6 * i + 6);
    const mass = opacities[i] * (xx * yy + yy * zz + zz * xx);
    const color = 12 * (shOrder === undefined ? i : shOrder[i]);
    for (let k = 0; k < 3; k++) {
      sums[k] += mass * positions[3 * i + k];
      sums[3 + k] += mass * sh[color + k];
    }
    sums[6] += mass;
  }
  return Array.from(sums.subarray(0, 6), (sum) => sum / sums[6]);
}

test('splats of no opacity, without extent in two axes, or in one and the same place are merged all the same', () => {
  const count = 1500;
  const degenerate = { ...pebbles(count) };
  for (let i = 0; i < count; i++) {
    if (i % 3 === 0) degenerate.opacities[i] = 0;
    if (i % 3 === 1) degenerate.scales.fill(0, 3 * i + 1, 3 * i + 3);
    if (i % 3 === 2) degenerate.positions.set([1, 2, 3], 3 * i);
  }
  const { geometry, details } = packWithDetail(degenerate) as Required<PackedGaussians>;
  const exponents = geometry.filter((_, k) => k % 8 < 4).map((word) => (word >>> 23) & 0xff);
  assert.ok(exponents.every((exponent) => exponent !== 0xff));
  assert.ok(details.filter((_, k) => k % DETAIL_NUMBERS < DETAIL_NUMBERS - 1).every(Number.isFinite));
});
