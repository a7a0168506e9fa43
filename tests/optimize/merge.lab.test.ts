/** Merging of pairs: the result, the unchanged splats, and the savings. Images are drawn on the CPU. */
import assert from 'node:assert/strict';
import { before, test } from 'node:test';
import { boundsOf, type GaussianCloud } from '@gaussian-splat/core';
import {
  viewSplitAround,
  decibels,
  optimize,
  meanSquare,
  MergingEvaluator,
  type Cut,
  type ReducedCloud,
} from '@gaussian-splat/optimize';
import { reduce } from './twin/reduce.js';
import { readScene } from '@gaussian-splat/formats';
import { smallCloud } from '../formats/support/small-cloud.js';
import { covarianceOf } from '../support/generator-tensors.js';
import { findMerges } from '../../packages/optimize/src/merge/find-merges.js';
import { ThreadPool } from '../../packages/cli/src/lib/thread-pool.mjs';
import { cpuPainter, PaintedEvaluator } from './twin/index.js';

const SIZE = { width: 120, height: 80 };
const SPLATS = 600;

/** A ball of splats; each but the last hundred has a twin close by, a tenth smaller and of nearly its color, that comes right after it. */
function twins(): GaussianCloud {
  const cloud = smallCloud(SPLATS, 1, 11);
  const numbers = 12;
  for (let i = 0; i < SPLATS; i++) {
    const p = cloud.positions.subarray(3 * i, 3 * i + 3);
    const radius = 1 / Math.hypot(...p);
    p.forEach((value, k) => (p[k] = value * radius));
    cloud.scales.set([0.07, 0.09, 0.05], 3 * i);
    cloud.opacities[i] = 0.3;
    for (let k = 0; k < numbers; k++) cloud.sh[numbers * i + k] *= 0.3;
  }
  for (let i = 1; i < SPLATS - 100; i += 2) {
    for (let k = 0; k < 3; k++) cloud.positions[3 * i + k] = cloud.positions[3 * i - 3 + k] + 0.004 * (k - 1);
    cloud.rotations.copyWithin(4 * i, 4 * i - 4, 4 * i);
    for (let k = 0; k < 3; k++) cloud.scales[3 * i + k] = 0.9 * cloud.scales[3 * i - 3 + k];
    for (let k = 0; k < numbers; k++) cloud.sh[numbers * i + k] = cloud.sh[numbers * (i - 1) + k] + 0.005;
  }
  return cloud;
}

const scene = twins();
const dealt = viewSplitAround(boundsOf(scene), { ...SIZE, scored: 24 });
const views = { ...dealt, searched: dealt.searched.slice(0, 4), heldOut: dealt.heldOut.slice(0, 4) };
const mergingTo = (decibels: number): MergingEvaluator =>
  new MergingEvaluator(new PaintedEvaluator(scene, { views }), scene, {
    views: views.scored,
    maxError: 10 ** (-decibels / 10),
  });

let merging: MergingEvaluator;
let photos: readonly Float32Array[];

before(async () => {
  merging = mergingTo(40);
  await merging.rank();
  photos = await cpuPainter.draw(scene, views.heldOut);
});

/** PSNR in dB for a cloud in the held-out views. */
async function figureOf(cloud: GaussianCloud): Promise<number> {
  const images = await cpuPainter.draw(cloud, views.heldOut);
  return decibels(images.reduce((sum, image, k) => sum + meanSquare(image, photos[k]), 0) / images.length);
}

/** The price at which the given number of merges is made. */
async function atMerges(count: number): Promise<{ cut: Cut; reduced: ReducedCloud }> {
  let [low, high] = [1e-20, 1];
  for (let tries = 0; tries < 60; tries++) {
    const mergePrice = Math.sqrt(low * high);
    if ((await merging.reduce({ mergePrice })).cloud.count > SPLATS - count) low = mergePrice;
    else high = mergePrice;
  }
  return { cut: { mergePrice: high }, reduced: await merging.reduce({ mergePrice: high }) };
}

test('twins are merged first: means and covariances are those of both', async () => {
  const { reduced } = await atMerges(150);
  const isKept = new Uint8Array(SPLATS);
  for (const i of reduced.kept) isKept[i] = 1;
  const gone = [...isKept.keys()].filter((i) => !isKept[i]);
  const pairs = new Set(gone.map((i) => i >> 1));
  assert.ok(gone.length >= 150 && gone.length < 160, `${gone.length} merges`);
  assert.ok(gone.filter((i) => i < SPLATS - 100).length > 0.95 * gone.length, 'those without a twin stay');
  assert.ok(pairs.size > 0.95 * gone.length, 'one of each pair');
  let checked = 0;
  for (let k = 0; k < reduced.cloud.count; k++) {
    const i = reduced.kept[k];
    const [a, b] = [i & ~1, i | 1];
    if (i >= SPLATS - 100 || isKept[a] === isKept[b]) continue;
    const at = (j: number): number[] => [...scene.positions.subarray(3 * j, 3 * j + 3)];
    const [from, to, found] = [at(a), at(b), [...reduced.cloud.positions.subarray(3 * k, 3 * k + 3)]];
    const along = to.map((value, axis) => value - from[axis]);
    const q =
      along.reduce((sum, value, axis) => sum + value * (found[axis] - from[axis]), 0) /
      along.reduce((sum, value) => sum + value * value, 0);
    assert.ok(q > 0.3 && q < 0.6, `the twin, of 0.81 of the area, counts for ${q}`);
    found.forEach((value, axis) => assert.ok(Math.abs(value - from[axis] - q * along[axis]) < 1e-5, 'on the line'));
    const [first, second] = [covarianceOf(scene, a), covarianceOf(scene, b)];
    const axes = [0, 0, 0, 1, 1, 2].map((row, n) => [row, [0, 1, 2, 1, 2, 2][n]]);
    covarianceOf(reduced.cloud, k).forEach((value, n) => {
      const [row, column] = axes[n];
      const expected = (1 - q) * first[n] + q * second[n] + q * (1 - q) * along[row] * along[column];
      assert.ok(Math.abs(value - expected) < 2e-5, `covariance ${n}: ${value}, expected ${expected}`);
    });
    const numbers = 12;
    for (let n = 0; n < numbers; n++) {
      const expected = (1 - q) * scene.sh[numbers * a + n] + q * scene.sh[numbers * b + n];
      assert.ok(Math.abs(reduced.cloud.sh[numbers * k + n] - expected) < 1e-4, 'the mean color');
    }
    checked++;
  }
  assert.ok(checked > 100, `${checked} checked`);
});

test('coverage is preserved: alpha of the images stays the same', async () => {
  const { reduced } = await atMerges(200);
  const images = await cpuPainter.draw(reduced.cloud, views.heldOut);
  const sum = (image: Float32Array): number => image.reduce((all, value, k) => all + (k % 4 === 3 ? value : 0), 0);
  images.forEach((image, k) => {
    const ratio = sum(image) / sum(photos[k]);
    assert.ok(Math.abs(ratio - 1) < 0.005, `view ${k}: ${ratio}`);
  });
});

test('merging loses less than dropping as many', async () => {
  const { reduced } = await atMerges(200);
  const scores = await new PaintedEvaluator(scene, { views }).rank();
  const price = scores.removalError.slice().sort()[SPLATS - reduced.cloud.count];
  const dropped = await merging.reduce({ removalPrice: price });
  assert.ok(Math.abs(dropped.cloud.count - reduced.cloud.count) < 3);
  const [merged, without] = [await figureOf(reduced.cloud), await figureOf(dropped.cloud)];
  console.log(`a third merged: ${merged.toFixed(1)} dB, dropped ${without.toFixed(1)} dB`);
  assert.ok(merged > without + 6, `${merged} dB, dropped ${without} dB`);
});

test('a merge whose other half is dropped is not made, and saves nothing twice', async () => {
  const { cut, reduced } = await atMerges(200);
  const price = (await new PaintedEvaluator(scene, { views }).rank()).removalError.slice().sort()[120];
  const dropped = await merging.reduce({ removalPrice: price });
  const both = await merging.reduce({ ...cut, removalPrice: price });
  const isDropped = new Uint8Array(SPLATS).fill(1);
  for (const i of dropped.kept) isDropped[i] = 0;
  assert.ok(
    both.kept.every((i) => !isDropped[i]),
    'what is dropped does not come back',
  );
  assert.ok(
    both.cloud.count < dropped.cloud.count && both.cloud.count > reduced.cloud.count - (SPLATS - dropped.cloud.count),
  );
  // Splats whose partner went are as they were.
  const whole = [...both.kept.keys()].filter((k) => isDropped[both.kept[k] ^ 1] && both.kept[k] < SPLATS - 100);
  const same = whole.filter((k) => both.cloud.opacities[k] === scene.opacities[both.kept[k]]);
  assert.ok(whole.length > 20 && same.length > 0.8 * whole.length, `${same.length} of ${whole.length}`);
});

test('colors keep the bands of the one that keeps more, and the most seen come first', async () => {
  const { cut } = await atMerges(200);
  const plain = await merging.reduce({ colorPrice: 1e-9 });
  const merged = await merging.reduce({ ...cut, colorPrice: 1e-9 });
  const degreeOf = new Map([...plain.kept].map((i, k) => [i, plain.degrees[k]]));
  merged.kept.forEach((i, k) => {
    if (i >= SPLATS - 100) return;
    assert.ok(merged.degrees[k] >= degreeOf.get(i)!);
  });
  const isKept = new Set(merged.kept);
  const place = new Map([...plain.kept].map((i, k) => [i, k]));
  const leads = [...merged.kept].map((i) =>
    i >= SPLATS - 100 || isKept.has(i ^ 1) ? place.get(i)! : Math.min(place.get(i)!, place.get(i ^ 1)!),
  );
  const inOrder = leads.filter((lead, k) => k === 0 || lead > leads[k - 1]).length;
  assert.ok(inOrder > 0.95 * leads.length, `${inOrder} of ${leads.length}`);
});

test('the source is left as it is', async () => {
  await merging.reduce({ mergePrice: 1, colorPrice: 1e-10 });
  assert.deepEqual(scene, twins());
});

test('without a price nothing is merged', async () => {
  const painted = new PaintedEvaluator(scene, { views });
  const scores = await painted.rank().then(() => painted.scores());
  assert.deepEqual(await merging.reduce({ minContribution: 0.05 }), reduce(scene, scores, { minContribution: 0.05 }));
});

for (const minPsnr of [57, 44]) {
  test(`at ${minPsnr} dB fewer splats stay, and the figure is kept in views that had no say`, async () => {
    const options = { minPsnr, name: 'a.glb' };
    const without = await optimize(scene, { ...options, evaluator: new PaintedEvaluator(scene, { views }) });
    const result = await optimize(scene, { ...options, evaluator: mergingTo(minPsnr) });
    const written = await readScene(result.bytes, { name: 'a.glb' });
    const found = await figureOf(written);
    console.log(`${minPsnr} dB: ${result.splats.after} of ${SPLATS} splats, without merging ${without.splats.after}`);
    assert.ok(found >= minPsnr && Math.abs(found - result.psnr) < 1e-6, `${found} dB`);
    assert.equal(written.count, result.splats.after);
    assert.ok(result.splats.after < 0.95 * without.splats.after, `${result.splats.after} of ${without.splats.after}`);
    assert.ok((result.cut.mergePrice ?? 0) > 0);
  });
}

test('threads find the merges that one finds', async () => {
  const ranking = await new PaintedEvaluator(scene, { views }).rank();
  const alone = await findMerges(scene, ranking, views.scored, 1e-4);
  assert.ok(alone.into.length > 100, `${alone.into.length} merges`);
  for (const threads of [2, 3]) {
    const pool = new ThreadPool(threads, 1000);
    try {
      assert.deepEqual(await findMerges(scene, ranking, views.scored, 1e-4, pool), alone);
    } finally {
      await pool.close();
    }
  }
});
