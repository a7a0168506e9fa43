/** Scores, cuts and errors on the GPU, against those of plain code. Parts of 256 splats, so that a scene has several. */
import assert from 'node:assert/strict';
import { after, before, test } from 'node:test';
import { boundsOf, eyeOf, type GaussianCloud } from '@gaussian-splat/core';
import {
  viewSplitAround,
  decibels,
  degreesOf,
  optimize,
  GpuEvaluator,
  meanSquare,
  MergingEvaluator,
  type Cut,
  type Ranking,
  type Scores,
} from '@gaussian-splat/optimize';
import { reduce } from './twin/reduce.js';
import { readScene } from '@gaussian-splat/formats';
import { smallCloud } from '../formats/support/small-cloud.js';
import { endNodeDevice, serialDevice } from '../support/node-device.js';
import { basisOf } from '../support/seen-from.js';
import { type ContributionScorer, cpuScorer, PaintedEvaluator, scoreSplats, Studio } from './twin/index.js';

const SIZE = { width: 64, height: 48 };
const COUNT = 900;

/** A ball of splats of degree 3, some dim, some inside, and colors that depend on the view. */
function ball(): GaussianCloud {
  const cloud = smallCloud(COUNT, 3, 7);
  for (let i = 0; i < COUNT; i++) {
    const p = cloud.positions.subarray(3 * i, 3 * i + 3);
    const radius = (i % 4 === 0 ? 0.5 : 1) / Math.hypot(...p);
    p.forEach((value, k) => (p[k] = value * radius));
    cloud.scales.fill(0.09 + 0.04 * (i % 3), 3 * i, 3 * i + 3);
    cloud.scales[3 * i] *= 0.3;
    cloud.opacities[i] = i % 5 === 0 ? 0.05 : 0.9;
    for (let k = 48 * i + 3; k < 48 * i + 48; k++) cloud.sh[k] *= i % 2 === 0 ? 0.02 : 0.3;
  }
  return cloud;
}

const scene = ball();
const dealt = viewSplitAround(boundsOf(scene), SIZE);
const views = {
  scored: dealt.scored.slice(0, 16),
  searched: dealt.searched.slice(0, 1),
  heldOut: dealt.heldOut.slice(0, 2),
};

let device: GPUDevice;
let evaluator: GpuEvaluator;
let ranking: Ranking;
let scores: Scores;

before(async () => {
  device = await serialDevice();
  evaluator = await GpuEvaluator.create(device, scene, views, { partSplats: 256 });
  ranking = await evaluator.rank();
  scores = await evaluator.scores();
});

/** Largest difference of two lists of numbers, in parts of the largest of the second. */
function apart(found: ArrayLike<number>, expected: ArrayLike<number>): number {
  let [max, largest] = [0, 0];
  for (let i = 0; i < expected.length; i++) {
    if (found[i] !== expected[i]) max = Math.max(max, Math.abs(found[i] - expected[i]));
    if (Number.isFinite(expected[i])) largest = Math.max(largest, Math.abs(expected[i]));
  }
  return max / largest;
}

test('how splats are seen: energies are means over the views, and roots those of the moments of what each view saw', async () => {
  const { energies, roots } = await evaluator.seen();
  const own = await Promise.all(views.scored.map((_, v) => evaluator.energiesIn(v)));
  const means = energies.map((_, i) => own.reduce((sum, energy) => sum + energy[i], 0) / own.length);
  assert.ok(apart(energies, means) < 1e-5);
  for (const i of [0, 1, 300, 577, COUNT - 1]) {
    const root = roots.subarray(136 * i, 136 * (i + 1));
    const squares = views.scored.map(({ worldToCamera }, v) => {
      const eye = eyeOf(worldToCamera);
      const d = eye.map((x, axis) => scene.positions[3 * i + axis] - x);
      return { weight: own[v][i] / (own.length * energies[i]), basis: basisOf(d.map((x) => x / Math.hypot(...d))) };
    });
    for (let r = 0; r < 9; r++) {
      for (let c = 0; c <= r; c++) {
        const moment = squares.reduce((sum, { weight, basis }) => sum + weight * basis[r] * basis[c], 0);
        let found = r === c ? -0.1 / (4 * Math.PI) : 0;
        for (let j = 0; j <= c; j++) found += root[(r * (r + 1)) / 2 + j] * root[(c * (c + 1)) / 2 + j];
        assert.ok(Math.abs(found - moment) < 1e-3, `splat ${i}, row ${r}, column ${c}: ${found}, not ${moment}`);
      }
    }
  }
});

test('sums, colors and errors are those of plain code from the same contributions', async () => {
  const given: ContributionScorer = async (camera) => {
    const energy = await evaluator.energiesIn(views.scored.indexOf(camera));
    return { energy, peak: new Float32Array(COUNT), removal: energy.map((value) => 0.02 * value) };
  };
  const expected = await scoreSplats(scene, views.scored, given);
  assert.ok(expected.removalError.some(Number.isFinite));
  assert.ok(apart(ranking.removalError, expected.removalError) < 1e-5);
  assert.equal(scores.lowered.length, 3);
  for (const [degree, { error, of }] of scores.lowered.entries()) {
    const theirs = expected.lowered[degree];
    assert.ok(theirs.error.some((value) => value > 0));
    assert.ok(apart(error, theirs.error) < 2e-3, `degree ${degree}: errors ${apart(error, theirs.error)} apart`);
    let worst = 0;
    for (let i = 0; i < COUNT; i++) {
      const [a, b] = [of(i), theirs.of(i)];
      assert.equal(a.length, 3 * (degree + 1) ** 2);
      for (let k = 0; k < b.length; k++) worst = Math.max(worst, Math.abs(a[k] - b[k]));
    }
    // The GPU has the scene's coefficients in float16.
    assert.ok(worst < 2e-3, `degree ${degree}: coefficients ${worst} apart`);
  }
});

test('contributions are those that plain code blends, and energies near those that it sums', async () => {
  const cpu = cpuScorer(scene);
  const expected = new Float32Array(COUNT);
  let [found, summed] = [0, 0];
  for (const [k, camera] of views.scored.entries()) {
    const { peak, energy } = await cpu(camera);
    peak.forEach((value, i) => (expected[i] = Math.max(expected[i], value)));
    summed += energy.reduce((sum, value) => sum + value, 0);
    found += (await evaluator.energiesIn(k)).reduce((sum, value) => sum + value, 0);
  }
  const judged = [...ranking.removalError.keys()].filter((i) => Number.isFinite(ranking.removalError[i]));
  assert.ok(judged.length > 0.9 * COUNT, `${judged.length} judged`);
  const differences = judged.map((i) => Math.abs(ranking.contribution[i] - expected[i]));
  const worst = Math.max(...differences);
  assert.ok(worst < 0.03, `worst ${worst}`);
  assert.ok(differences.reduce((sum, value) => sum + value, 0) / judged.length < 1e-3);
  // Estimated from peak and size, as if nothing stood before any part of a splat.
  assert.ok(found > 0.7 * summed && found < 3 * summed, `${found} where the CPU finds ${summed}`);
});

test('a scene in parts is scored as one in a single part', async () => {
  const single = await GpuEvaluator.create(device, scene, views);
  assert.deepEqual(await single.rank(), ranking);
  const whole = await single.scores();
  single.destroy();
  for (const [degree, { error, of }] of whole.lowered.entries()) {
    assert.deepEqual(error, scores.lowered[degree].error);
    for (let i = 0; i < COUNT; i += 7) assert.deepEqual(of(i), scores.lowered[degree].of(i));
  }
});

test('views that are scored a few at a time add up to the same', async () => {
  const few = await GpuEvaluator.create(device, scene, views, { viewsAtOnce: 5 });
  assert.deepEqual(await few.rank(), ranking);
  const found = await few.scores();
  few.destroy();
  for (const [degree, { error, of }] of found.lowered.entries()) {
    assert.ok(apart(error, scores.lowered[degree].error) < 1e-4);
    for (let i = 0; i < COUNT; i += 7) assert.ok(apart(of(i), scores.lowered[degree].of(i)) < 1e-4, `splat ${i}`);
  }
});

test('errors are those of the images', async () => {
  const cloud = { ...scene, opacities: scene.opacities.map((value, i) => (i % 9 === 0 ? 0.5 * value : value)) };
  const studio = new Studio(device, 'reference');
  const [before, now] = [await studio.draw(scene, views.heldOut), await studio.draw(cloud, views.heldOut)];
  studio.destroy();
  const found = await evaluator.compare(cloud, 'heldOut');
  now.forEach((image, k) => {
    const expected = meanSquare(image, before[k]);
    assert.ok(expected > 1e-6 && Math.abs(found[k] - expected) < 1e-4 * expected, `${found[k]}, expected ${expected}`);
  });
  assert.deepEqual(await evaluator.compare(scene, 'heldOut'), [0, 0]);
});

test('empty views report no error', async () => {
  const [first] = views.heldOut;
  const worldToCamera = first.worldToCamera.map((value, k) => (k >= 4 && k < 12 ? -value : value));
  const turned = { ...views, scored: [first], heldOut: [first, { ...first, worldToCamera }] };
  const blind = await GpuEvaluator.create(device, scene, turned);
  const darker = { ...scene, opacities: scene.opacities.map((value) => 0.9 * value) };
  const errors = await blind.compare(darker, 'heldOut');
  blind.destroy();
  assert.ok(errors.length === 1 && errors[0] > 1e-5, errors.join());
});

const median = (values: Float32Array, share: number): number =>
  values.slice().sort()[Math.floor(share * values.length)];

for (const [name, cutOf] of [
  ['by contribution', () => ({ minContribution: median(ranking.contribution, 0.2) })],
  ['by the loss in the images', () => ({ removalPrice: median(ranking.removalError, 0.15) })],
  ['of bands of color', () => ({ colorPrice: Math.fround(1e-9) })],
  ['of both', () => ({ minContribution: median(ranking.contribution, 0.1), colorPrice: Math.fround(1e-10) })],
] as const satisfies readonly (readonly [string, () => Cut])[]) {
  test(`a cut on the GPU shows what the reduced cloud shows: ${name}`, async () => {
    const cut = cutOf();
    const { cloud, degrees } = reduce(scene, scores, cut);
    const found = await evaluator.cut(cut, 'heldOut');
    assert.deepEqual(found.degrees, degreesOf(degrees));
    const taken = await evaluator.reduce(cut);
    assert.deepEqual(taken.degrees, degrees);
    assert.deepEqual(taken.cloud, cloud);
    const expected = await evaluator.compare(cloud, 'heldOut');
    found.errors.forEach((error, k) => {
      assert.ok(error > 1e-9, 'something is lost');
      assert.ok(Math.abs(error - expected[k]) < 0.01 * expected[k], `view ${k}: ${error}, drawn again ${expected[k]}`);
    });
  });
}

// Far above: no camera looks there.
test('splats outside all views keep their colors, as they keep their position', async () => {
  const cloud = {
    ...scene,
    positions: scene.positions.map((value, k) => (k < 30 && k % 3 === 1 ? value - 1000 : value)),
  };
  const other = await GpuEvaluator.create(device, cloud, views);
  await other.rank();
  const cut = { removalPrice: 1e-4, colorPrice: 1e-4 };
  const { degrees, kept, cloud: left } = await other.reduce(cut);
  const expected = reduce(cloud, await other.scores(), cut);
  other.destroy();
  assert.deepEqual([...degrees.filter((_, k) => kept[k] < 10)], new Array(10).fill(3));
  assert.ok(kept.length < 0.9 * COUNT && degrees.filter((degree) => degree === 0).length > 0.5 * kept.length);
  assert.deepEqual([left, degrees], [expected.cloud, expected.degrees]);
});

test('a cut can be taken back', async () => {
  await evaluator.cut({ minContribution: 0.5 }, 'searched');
  const { errors, degrees } = await evaluator.cut({}, 'searched');
  assert.deepEqual([errors, degrees], [[0], [0, 0, 0, COUNT]]);
});

test('splats of planes stay in the order of the file, in which those at one depth are painted', async () => {
  const positions = scene.positions.map((value, k) => (k % 3 === 2 ? 1 : value));
  const own = await GpuEvaluator.create(device, { ...scene, positions }, views);
  await own.rank();
  const { kept } = await own.reduce({ minContribution: 0.5 });
  own.destroy();
  assert.ok(kept.length > 10 && kept.length < COUNT, `${kept.length} of ${COUNT}`);
  assert.deepEqual(kept, kept.slice().sort());
});

test('the asked figure is met by the written file', async () => {
  const result = await optimize(scene, { minPsnr: 45, name: 'a.glb', evaluator });
  const written = await readScene(result.bytes, { name: 'a.glb' });
  const errors = await evaluator.compare(written, 'heldOut');
  const found = decibels(errors.reduce((sum, error) => sum + error, 0) / errors.length);
  assert.ok(found >= 45 && Math.abs(found - result.psnr) < 1e-6, `${found} dB, ${result.psnr} dB said`);
  assert.equal(written.count, result.splats.after);
  assert.ok(result.splats.after < COUNT && result.coefficients.after < result.coefficients.before);
  assert.ok(result.seconds.score > 0 && result.seconds.search > 0);
});

test('pairs are merged by its scores, and the cost is measured on its images', async () => {
  const merging = new MergingEvaluator(evaluator, scene, { views: views.scored, maxError: 1e-3 });
  assert.deepEqual(await merging.rank(), ranking);
  const [mergePrice] = merging.mergePrices.slice(-1);
  const cut: Cut = { mergePrice, minContribution: median(ranking.contribution, 0.1) };
  const { cloud } = await merging.reduce(cut);
  const { cloud: dropped } = await evaluator.reduce(cut);
  assert.ok(cloud.count < 0.95 * dropped.count, `${cloud.count} of ${dropped.count}`);
  const { errors, degrees } = await merging.cut(cut, 'heldOut');
  assert.deepEqual(degrees, [0, 0, 0, cloud.count]);
  assert.deepEqual(errors, await evaluator.compare(cloud, 'heldOut'));
  // As the CPU's scores would have it, within what float16 and peaks leave open.
  const cpu = new MergingEvaluator(new PaintedEvaluator(scene, { views }), scene, {
    views: views.scored,
    maxError: 1e-3,
  });
  await cpu.rank();
  const theirs = await cpu.reduce({ mergePrice });
  const ours = await merging.reduce({ mergePrice });
  assert.ok(Math.abs(ours.cloud.count - theirs.cloud.count) < 0.1 * (COUNT - theirs.cloud.count) + 2);
});

test('an end is an end', async () => {
  const signal = AbortSignal.abort(new Error('over'));
  await assert.rejects(evaluator.rank(signal), /over/);
  await assert.rejects(evaluator.cut({}, 'searched', signal), /over/);
});

after(async () => {
  evaluator.destroy();
  await endNodeDevice();
});
