import assert from 'node:assert/strict';
import { test } from 'node:test';
import { readScene } from '@gaussian-splat/formats';
import {
  assertAtMost,
  assertSameCloud,
  expectRefusal,
  largestDifference,
  largestRotationError,
} from './support/expect.js';
import { writeKsplat } from './support/ksplat-writer.js';
import { smallCloud } from './support/small-cloud.js';

const BOUNDS = [
  { position: 0, scale: 0, rotation: 1e-6, color: 0.5 / 255 / 0.28 },
  { position: 1e-4, scale: 2e-4, rotation: 1e-6, color: 0.5 / 255 / 0.28 },
  { position: 1e-4, scale: 2e-4, rotation: 1e-6, color: 1.5 / 255 / 0.28 },
] as const;

for (const level of [0, 1, 2] as const) {
  for (const degree of [0, 1, 2, 3] as const) {
    test(`level ${level}, degree ${degree}: every attribute to the bits of the format`, async () => {
      const cloud = smallCloud(23, degree);
      const bound = BOUNDS[level];
      const read = await readScene(writeKsplat(cloud, { level }), { name: 'a' });
      assert.deepEqual([read.count, read.shDegree, read.droppedCount], [23, degree, 0]);
      assertAtMost(largestDifference(read.positions, cloud.positions), bound.position, 'positions');
      assertAtMost(largestDifference(read.scales, cloud.scales), bound.scale, 'scales');
      assertAtMost(largestRotationError(read, cloud), bound.rotation, 'rotations');
      assertAtMost(largestDifference(read.opacities, cloud.opacities), 0.51 / 255, 'opacities');
      assertAtMost(largestDifference(read.sh, cloud.sh), bound.color, 'colors');
    });
  }
}

test('the number of sections that were filled is not asked for, as GaussianSplats3D does not', async () => {
  const file = writeKsplat(smallCloud(23, 1), { level: 1 });
  const without = Uint8Array.from(file);
  new DataView(without.buffer).setUint32(8, 0, true);
  assertSameCloud(await readScene(without, { name: 'a.ksplat' }), await readScene(file, { name: 'a.ksplat' }));
});

test('headers that announce more than the file has are refused before anything is allocated', async () => {
  const file = writeKsplat(smallCloud(23, 1), { level: 1 });
  const changed = (at: number, value: number): Uint8Array => {
    const copy = Uint8Array.from(file);
    new DataView(copy.buffer).setUint32(at, value, true);
    return copy;
  };
  await expectRefusal(changed(4, 0xffffffff), 'decode/truncated', /section headers/, { name: 'a.ksplat' });
  const many = changed(4096, 0x7fffffff);
  new DataView(many.buffer).setUint32(4100, 0x7fffffff, true);
  await expectRefusal(many, 'decode/truncated', /2,147,483,647 splats/, { name: 'a.ksplat' });
  await expectRefusal(changed(4096 + 32, 0xffff), 'decode/header', /buckets/, { name: 'a.ksplat' });
  await expectRefusal(changed(4096 + 40, 9), 'decode/header', /degree/, { name: 'a.ksplat' });
});

test('a range of coefficients that is not finite is refused; the zeros of old files mean the default range', async () => {
  const cloud = smallCloud(23, 1);
  const file = writeKsplat(cloud, { level: 2 });
  const ranged = (low: number, high: number): Uint8Array => {
    const copy = Uint8Array.from(file);
    const view = new DataView(copy.buffer);
    view.setFloat32(36, low, true);
    view.setFloat32(40, high, true);
    return copy;
  };
  for (const [low, high] of [
    [NaN, 1.5],
    [-1.5, NaN],
    [-Infinity, 1.5],
  ] as const)
    // prettier-ignore
    await expectRefusal(ranged(low, high), 'decode/header', /numbers that are not finite/, { name: 'a.ksplat' });
  assertSameCloud(await readScene(ranged(0, 0), { name: 'a' }), await readScene(ranged(-1.5, 1.5), { name: 'a' }));
});
