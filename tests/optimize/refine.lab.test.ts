/** Refining of reduced scenes: derivatives against those of plain code, and the gain in views that it was not fitted to. */
import assert from 'node:assert/strict';
import { after, before, test } from 'node:test';
import { boundsOf, eyeOf, GaussianSplatError, type Camera, type GaussianCloud } from '@gaussian-splat/core';
import { viewSplitAround, decibels, optimize, meanSquare, RefiningEvaluator } from '@gaussian-splat/optimize';
import { readScene } from '@gaussian-splat/formats';
import { readBack } from '@gaussian-splat/renderer/tools';
import { CloudBuffers } from '../../packages/optimize/src/gpu/cloud-buffers.js';
import { ImageErrors } from '../../packages/optimize/src/gpu/image-errors.js';
import { RefinedScene } from '../../packages/optimize/src/refine/refined-scene.js';
import { SceneFitter, USUAL_DESCENT } from '../../packages/optimize/src/refine/scene-fitter.js';
import { smallCloud } from '../formats/support/small-cloud.js';
import { endNodeDevice, serialDevice } from '../support/node-device.js';
import { seededRandom } from '../support/random.js';
import { cpuPainter, PaintedEvaluator } from './twin/index.js';
import { Renderer } from '../support/renderer.js';

const SIZE = 32;
const DEGREE = 1;
const NUMBERS = 12;

/** A ball of large splats, some of them inside, whose colors depend on the view. */
function ball(count: number): GaussianCloud {
  const cloud = smallCloud(count, DEGREE, 7);
  for (let i = 0; i < count; i++) {
    const p = cloud.positions.subarray(3 * i, 3 * i + 3);
    const radius = (i % 4 === 0 ? 0.5 : 1) / Math.hypot(...p);
    p.forEach((value, k) => (p[k] = value * radius));
    cloud.scales.set([0.15 + 0.1 * (i % 3), 0.25, 0.12 + 0.05 * (i % 2)], 3 * i);
    cloud.opacities[i] = 0.1 + 0.8 * ((0.618 * i) % 1);
    for (let k = 0; k < NUMBERS; k++) cloud.sh[NUMBERS * i + k] *= k < 3 ? 0.6 : 0.1;
  }
  return cloud;
}

/** A ball of half as many splats, each of them twice: with one of two gone, the other can stand for both. */
function twins(count: number): GaussianCloud {
  const cloud = ball(count);
  for (let i = 0; i < count; i++) {
    cloud.opacities[i] *= 0.4;
    if (i % 2 === 0) continue;
    for (const values of [cloud.positions, cloud.scales, cloud.rotations, cloud.opacities, cloud.sh]) {
      const width = values.length / count;
      values.copyWithin(width * i, width * (i - 1), width * i);
    }
  }
  return cloud;
}

/** All but the first splats. */
function without(whole: GaussianCloud, gone: number): GaussianCloud {
  const { count, positions, scales, rotations, opacities, sh } = whole;
  const rest = (values: Float32Array): Float32Array => values.slice((gone * values.length) / count);
  return {
    ...{ ...whole, count: count - gone, positions: rest(positions), scales: rest(scales) },
    ...{ rotations: rest(rotations), opacities: rest(opacities), sh: rest(sh) },
  };
}

/** The same with all its numbers off by a little. */
function disturbed(cloud: GaussianCloud): GaussianCloud {
  const random = seededRandom(3);
  const off = (values: Float32Array, by: (value: number) => number): Float32Array => values.map(by);
  const near = (size: number): number => random.uniform(-size, size);
  return {
    ...cloud,
    positions: off(cloud.positions, (value) => value + near(0.006)),
    scales: off(cloud.scales, (value) => value * (1 + near(0.02))),
    opacities: off(cloud.opacities, (value) => value * (1 + near(0.02))),
    sh: off(cloud.sh, (value) => value + near(0.02)),
  };
}

let device: GPUDevice;
let renderer: Renderer;

before(async () => {
  device = await serialDevice();
  renderer = new Renderer(device, { quality: 'reference' });
});

async function imagesOf(cloud: GaussianCloud, views: readonly Camera[]): Promise<ImageErrors> {
  const gaussians = await CloudBuffers.upload(device, cloud);
  const images = await ImageErrors.of(device, renderer, gaussians, views);
  gaussians.destroy();
  return images;
}

/** Squared error of the colors over the covered pixels, as the fitter weighs it. */
function lossOf(images: readonly Float32Array[], references: readonly Float32Array[]): number {
  return images.reduce((sum, image, k) => sum + 3 * SIZE * SIZE * meanSquare(image, references[k]), 0);
}

/** Gauss and Newton's curvature of that error of a view along a number: by the images with it a step less and a step more. */
function curvatureOf(less: Float32Array, more: Float32Array): number {
  return (2 * lossOf([less], [more])) / (2 * STEP) ** 2;
}

/** One number of a splat moved along a direction of the fitter. */
function moved(cloud: GaussianCloud, i: number, number: number, by: number): GaussianCloud {
  const [positions, scales, rotations] = [cloud.positions.slice(), cloud.scales.slice(), cloud.rotations.slice()];
  const [opacities, sh] = [cloud.opacities.slice(), cloud.sh.slice()];
  const [w, x, y, z] = rotations.subarray(4 * i, 4 * i + 4);
  const axis = number % 3;
  const e = [0, 1, 2].map((k) => +(k === axis));
  if (number < 3) {
    const own = scales.subarray(3 * i, 3 * i + 3);
    const step = by * Math.max(own[axis], 0.02 * Math.max(...own));
    const along = [
      [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)],
      [2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)],
      [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)],
    ][axis];
    along.forEach((value, k) => (positions[3 * i + k] += step * value));
  } else if (number < 6) scales[3 * i + axis] *= Math.exp(by);
  else if (number < 9) {
    const [s, t] = [1, 2].map((k) => scales[3 * i + ((axis + k) % 3)]);
    const [a, b, c] = e.map((value) => (by / 2) * value * Math.min(s / t, t / s));
    const q = [
      w - x * a - y * b - z * c,
      x + w * a + y * c - z * b,
      y + w * b + z * a - x * c,
      z + w * c + x * b - y * a,
    ];
    const length = Math.hypot(...q);
    rotations.set(
      q.map((value) => value / length),
      4 * i,
    );
  } else if (number === 9) opacities[i] = 1 / (1 + (1 / opacities[i] - 1) * Math.exp(-by));
  else sh[NUMBERS * i + number - 10] += by;
  return { ...cloud, positions, scales, rotations, opacities, sh };
}

/** The fitter's parameters: their kinds, the first of each and the one behind the last; which of four curvatures they use, and its allowed ratio to the exact curvature: scales, turns and steps have bounds, and harmonics have one together. */
const KINDS = {
  positions: { span: [0, 3], bend: 3, kept: [1, Infinity] },
  scales: { span: [3, 6], bend: 2, kept: [1, Infinity] },
  rotations: { span: [6, 9], bend: 2, kept: [1, Infinity] },
  opacity: { span: [9, 10], bend: 1, kept: [0.8, 1.2] },
  color: { span: [10, 13], bend: 0, kept: [3.9, 4.1] },
  bands: { span: [13, 22], bend: 0, kept: [1, Infinity] },
};
const MIN_CURVATURE = 1e-4;
/** Steps of `Descent.newton`: none is shortened. */
const UNLIMITED = 1e38;
const STEP = 1e-2;

for (const antialiased of [false, true]) {
  test(`derivatives are those of the reference code${antialiased ? ', antialiased' : ''}`, async () => {
    const count = 40;
    const whole = { ...ball(count), antialiased };
    const cloud = disturbed(whole);
    const views = viewSplitAround(boundsOf(whole), { width: SIZE, height: SIZE, scored: 24 }).scored.slice(0, 2);
    const images = await imagesOf(whole, views);
    // A splat that keeps fewer bands.
    const degrees = new Uint8Array(count).fill(DEGREE);
    degrees[3] = 0;
    const scene = await RefinedScene.of(device, { cloud, degrees });
    const fitter = new SceneFitter(device, renderer, scene, images);
    views.forEach((_, k) => fitter.look(k));
    const [{ gradients, bends, row }] = scene.parts;
    const read = await readBack(device, [{ buffer: gradients }, { buffer: bends }]);
    const [found, curvatures] = read.map((bytes) => new Float32Array(bytes));
    const references = await cpuPainter.draw(whole, views);
    for (const [
      kind,
      {
        span,
        bend,
        kept: [min, max],
      },
    ] of Object.entries(KINDS)) {
      const [first, end] = span;
      let [apart, size] = [0, 0];
      for (let i = 0; i < count; i += 5) {
        for (let number = first; number < end; number++) {
          const less = await cpuPainter.draw(moved(cloud, i, number, -STEP), views);
          const more = await cpuPainter.draw(moved(cloud, i, number, STEP), views);
          const expected = (lossOf(more, references) - lossOf(less, references)) / (2 * STEP);
          apart += (found[number * row + i] - expected) ** 2;
          size += expected ** 2;
          if (number >= 13 && degrees[i] === 0) continue;
          const curvature = Math.max(...views.map((_, k) => curvatureOf(less[k], more[k])));
          const kept = curvatures[4 * i + bend] / curvature;
          if (curvature > MIN_CURVATURE) assert.ok(kept > min && kept < max, `${kind} of splat ${i}: ${kept}`);
        }
      }
      // Splats that begin to paint a pixel, or cease to, do so at once: differences have that, derivatives do not.
      const off = Math.sqrt(apart / size);
      assert.ok(size > 0 && off < 0.12, `${kind}: ${off.toFixed(3)} apart`);
    }
    for (let number = 13; number < 22; number++) assert.equal(found[number * row + 3], 0, 'a band that went');
    fitter.destroy();
    scene.destroy();
    images.destroy();
  });
}

test('a few steps come nearer in views that were not fitted, and leave the source as it is', async () => {
  const count = 120;
  const whole = ball(count);
  const dealt = viewSplitAround(boundsOf(whole), { width: SIZE, height: SIZE, scored: 24 });
  const kept = Uint32Array.from({ length: 114 }, (_, k) => k + 6);
  const cloud = without(whole, 6);
  const before = structuredClone(cloud);
  const evaluator = new RefiningEvaluator(new PaintedEvaluator(whole, { views: dealt }), whole, {
    ...{ device, views: dealt.scored.slice(0, 12) },
    descent: { steps: 20 },
  });
  const degrees = new Uint8Array(114).fill(DEGREE);
  const refined = await evaluator.refine({ cloud, degrees, kept });
  assert.deepEqual(cloud, before);
  assert.deepEqual([refined.kept, refined.degrees], [kept, degrees]);
  const figure = async (other: GaussianCloud): Promise<number> => {
    const errors = await evaluator.compare(other, 'heldOut');
    return decibels(errors.reduce((sum, error) => sum + error, 0) / errors.length);
  };
  const [cut, reached] = [await figure(cloud), await figure(refined.cloud)];
  console.log(`a twentieth gone: ${cut.toFixed(1)} dB, refined ${reached.toFixed(1)} dB`);
  assert.ok(reached > cut + 1, `${reached} dB, ${cut} dB without`);
  evaluator.destroy();
});

/** A ball with a grain on it and, last, a large faint splat: of views that have an eye in it it fills all or nothing. */
function veiled(ball: GaussianCloud, eye: readonly number[]): GaussianCloud {
  const behind = (values: Float32Array, grain: readonly number[], veil: readonly number[]): Float32Array =>
    Float32Array.from([...values, ...grain, ...veil]);
  const color = Array.from({ length: NUMBERS }, (_, k) => (k < 3 ? 0.8 : 0.1));
  return {
    ...{ ...ball, count: ball.count + 2 },
    positions: behind(ball.positions, [0, -0.6, -1], eye),
    scales: behind(ball.scales, [0.006, 0.006, 0.006], [0.8, 0.5, 0.6]),
    rotations: behind(ball.rotations, [1, 0, 0, 0], [1, 0, 0, 0]),
    opacities: behind(ball.opacities, [0.9], [0.15]),
    sh: behind(ball.sh, color, color),
  };
}

test('a splat that the near plane cuts off in a view is not moved into it', async () => {
  const bare = ball(120);
  const dealt = viewSplitAround(boundsOf(bare), { width: SIZE, height: SIZE, scored: 24 });
  const [seen] = dealt.heldOut;
  const whole = veiled(bare, eyeOf(seen.worldToCamera));
  const cloud = without(whole, 6);
  const images = await imagesOf(whole, dealt.scored.slice(0, 12));
  const others = await imagesOf(whole, dealt.heldOut);
  const fitted = async (newton: number): Promise<{ before: number; after: number; read: GaussianCloud }> => {
    const scene = await RefinedScene.of(device, { cloud, degrees: new Uint8Array(cloud.count).fill(DEGREE) });
    const fitter = new SceneFitter(device, renderer, scene, images);
    const [before] = await others.measure(scene);
    const rates = { ...USUAL_DESCENT.rates, position: 0.01 };
    await fitter.fit({ ...USUAL_DESCENT, steps: 60, newton, rates });
    const [[after], read] = [await others.measure(scene), await scene.read()];
    fitter.destroy();
    scene.destroy();
    return { before, after, read };
  };
  const [limited, free] = [await fitted(USUAL_DESCENT.newton), await fitted(UNLIMITED)];
  const placeOf = ({ positions }: GaussianCloud, i: number): Float32Array => positions.subarray(3 * i, 3 * i + 3);
  const [grain, veil] = [cloud.count - 2, cloud.count - 1];
  assert.deepEqual(placeOf(limited.read, veil), placeOf(cloud, veil));
  assert.notDeepEqual(placeOf(limited.read, grain), placeOf(cloud, grain));
  assert.ok(limited.after < limited.before, `${limited.after} after ${limited.before}`);
  // Checks that this scene distinguishes the two.
  assert.ok(free.after > 10 * free.before, `${free.after} after ${free.before} without a limit`);
  images.destroy();
  others.destroy();
});

test('the figure is kept with fewer splats, and the source is left as it is', async () => {
  const whole = twins(200);
  const dealt = viewSplitAround(boundsOf(whole), { width: SIZE, height: SIZE, scored: 24 });
  const options = { minPsnr: 43, name: 'a.glb' };
  const painted = (): PaintedEvaluator => new PaintedEvaluator(whole, { views: dealt });
  const unrefined = await optimize(whole, { ...options, evaluator: painted() });
  const rates = { position: 0, growth: 0, turn: 0, logit: 0.08, constant: 0.004, harmonic: 0.001 };
  const descent = { rates, steps: 16 };
  const evaluator = new RefiningEvaluator(painted(), whole, { device, views: dealt.scored.slice(0, 12), descent });
  const result = await optimize(whole, { ...options, evaluator });
  const written = await readScene(result.bytes, { name: 'a.glb' });
  const errors = await evaluator.compare(written, 'heldOut');
  const found = decibels(errors.reduce((sum, error) => sum + error, 0) / errors.length);
  console.log(`43 dB: ${result.splats.after} of 200 splats, ${unrefined.splats.after} without; ${found.toFixed(1)} dB`);
  assert.ok(found >= 43 && Math.abs(found - result.psnr) < 1e-6, `${found} dB`);
  assert.ok(result.splats.after < 0.97 * unrefined.splats.after);
  assert.equal(written.count, result.splats.after);
  assert.deepEqual(whole, twins(200));
  evaluator.destroy();
});

test('without a device it says so', () => {
  const cloud = ball(4);
  const views = viewSplitAround(boundsOf(cloud));
  const options = { device: undefined as unknown as GPUDevice, views: views.scored };
  assert.throws(
    () => new RefiningEvaluator(new PaintedEvaluator(cloud, { views }), cloud, options),
    (error) => error instanceof GaussianSplatError && error.code === 'unsupported/no-webgpu',
  );
});

after(async () => {
  renderer.destroy();
  await endNodeDevice();
});
