/** SOG as optimize writes it: the file holds the rounded values, and steps and palettes are as coarse as errors allow. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { shCoefficientCount, type GaussianCloud, type ShDegree } from '@gaussian-splat/core';
import { encodingsFor, filesOfZip, writeSog, writeStreamedSog, type SogSteps } from '@gaussian-splat/optimize';
import { readLodScene, readScene } from '@gaussian-splat/formats';
import { packedOrder } from '@gaussian-splat/renderer/tools';
import { allocateSteps, fitSteps } from '../../packages/optimize/src/steps.js';
import { basisOf, cone, rootOf } from '../support/seen-from.js';
import { encodeWebp } from '../../packages/cli/src/lib/encoders.mjs';
import { randomSource } from '../support/gpu.js';
import { pebbles } from '../support/scenes/pebbles.js';

const FINEST: SogSteps = { place: 1, size: 1e-3, turn: 1, opacity: 1, color: 1e-3, harmonics: 1e-3 };

/** Stones whose colors are of a few kinds, so that a palette of as many holds them. */
function ofKinds(count: number, shDegree: ShDegree, kinds: number): GaussianCloud {
  const cloud = pebbles(count);
  const random = randomSource(3);
  const width = 3 * shCoefficientCount(shDegree);
  const palette = Float32Array.from({ length: kinds * width }, () => random() - 0.5);
  const sh = new Float32Array(width * count);
  for (let i = 0; i < count; i++) {
    sh.set(palette.subarray(width * (i % kinds), width * ((i % kinds) + 1)), width * i);
    sh.set(cloud.sh.subarray((cloud.sh.length / count) * i, (cloud.sh.length / count) * i + 3), width * i);
  }
  return { ...cloud, shDegree, sh };
}

const read = (bytes: Uint8Array): Promise<GaussianCloud> => readScene(bytes, { name: 'written.sog' });

for (const degree of [0, 1, 3] as const) {
  test(`degree ${degree}: each splat comes back, to the steps of the format`, async () => {
    const cloud = ofKinds(3_000, degree, 40);
    const found = await read(await writeSog(cloud, { steps: FINEST, palette: 64, encodeWebp, effort: 0 }));
    const order = packedOrder(cloud);
    assert.equal(found.count, order.length);
    const width = 3 * shCoefficientCount(degree);
    const range = (values: Float32Array): number =>
      values.reduce((a, b) => Math.max(a, b), -Infinity) - values.reduce((a, b) => Math.min(a, b), Infinity);
    const [positions, logs, colors] = [range(cloud.positions), range(cloud.scales.map(Math.log)), range(cloud.sh)];
    order.forEach((i, k) => {
      for (let n = 0; n < 3; n++) {
        assert.ok(Math.abs(found.positions[3 * k + n] - cloud.positions[3 * i + n]) <= (2 * positions) / 65_535);
        assert.ok(Math.abs(Math.log(found.scales[3 * k + n] / cloud.scales[3 * i + n])) <= logs / 500);
      }
      assert.ok(Math.abs(found.opacities[k] - cloud.opacities[i]) <= 0.51 / 255);
      const dot = [0, 1, 2, 3].reduce((sum, n) => sum + found.rotations[4 * k + n] * cloud.rotations[4 * i + n], 0);
      assert.ok(Math.abs(dot) > 0.9995, `turned by ${Math.acos(Math.abs(dot))}`);
      for (let n = 0; n < width; n++) {
        assert.ok(Math.abs(found.sh[width * k + n] - cloud.sh[width * i + n]) <= colors / 250, `coefficient ${n}`);
      }
    });
  });
}

test('coarser steps and smaller palettes make smaller files, and a flag for antialiasing stays', async () => {
  const cloud = { ...ofKinds(3_000, 2, 400), antialiased: true };
  const write = (steps: SogSteps, palette: number): Promise<Uint8Array> =>
    writeSog(cloud, { steps, palette, encodeWebp, effort: 0.3 });
  const coarse: SogSteps = { place: 64, size: 0.2, turn: 16, opacity: 16, color: 0.1, harmonics: 0.05 };
  const [fine, rough, few] = [await write(FINEST, 512), await write(coarse, 512), await write(FINEST, 16)];
  assert.ok(rough.length < 0.75 * fine.length, `${rough.length} of ${fine.length}`);
  assert.ok(few.length < fine.length, `${few.length} of ${fine.length}`);
  assert.equal((await read(rough)).antialiased, true);
});

test('positions have steps of powers of two, with which their low bytes have fewer values', async () => {
  const cloud = ofKinds(3_000, 0, 400);
  const write = (place: number): Promise<Uint8Array> =>
    writeSog(cloud, { steps: { ...FINEST, place }, palette: 64, encodeWebp, effort: 0.3 });
  const [two, three, four] = [await write(2), await write(3), await write(4)];
  assert.deepEqual(three, four);
  assert.ok(four.length < two.length - 400, `${four.length} after ${two.length}`);
});

test('where it is known how splats are seen, what they show from there is nearer with the same palette', async () => {
  const cloud = ofKinds(2_000, 2, 500);
  const random = randomSource(5);
  const [root, others] = [rootOf(cone(64, random)), cone(64, random).map(basisOf)];
  const roots = Float32Array.from({ length: 45 * cloud.count }, (_, k) => root[k % 45]);
  // Every fourth is in plain sight.
  const energies = Float32Array.from({ length: cloud.count }, (_, i) => (i % 4 === 0 ? 1 : 0.01) * 1e-4);
  const order = packedOrder(cloud);
  const [plain, fitting] = await Promise.all(
    [undefined, { energies, roots }].map(async (seen) => {
      const found = await read(await writeSog(cloud, { steps: FINEST, palette: 64, encodeWebp, effort: 0, seen }));
      let error = 0;
      order.forEach((i, k) => {
        for (const basis of others) {
          const added = basis.reduce((sum, y, j) => sum + y * (found.sh[27 * k + 3 * j] - cloud.sh[27 * i + 3 * j]), 0);
          error += energies[i] * added ** 2;
        }
      });
      return error;
    }),
  );
  console.log(`error as seen ${(fitting / plain).toFixed(2)} of that without`);
  assert.ok(fitting < 0.6 * plain, `${fitting} and ${plain}`);
});

test('each step has a fraction of the error in proportion to its numbers, for any errors', async () => {
  const weights = { a: 4, b: 0.01, c: 1 };
  const errorOf = (steps: Readonly<Record<'a' | 'b' | 'c', number>>): number =>
    weights.a * steps.a ** 2 + weights.b * steps.b ** 2 + weights.c * steps.c ** 2;
  const usual = { a: 0.1, b: 0.1, c: 0.1 };
  const numbers = { a: 3, b: 3, c: 6 };
  const steps = await allocateSteps({ usual, numbers, measure: async (s) => errorOf(s), target: 0.02 });
  assert.ok(Math.abs(errorOf(steps) - 0.02) < 0.006, `${errorOf(steps)}`);
  assert.ok(steps.b > steps.c && steps.c > steps.a, JSON.stringify(steps));
});

test('steps are scaled until they err as much as is allowed, and never more', async () => {
  for (const power of [1, 2, 3]) {
    let measured = 0;
    const measure = async ({ a }: { a: number }): Promise<{ error: number; a: number }> => {
      measured++;
      return { error: 1e-3 * a ** power + 2e-4, a };
    };
    const found = await fitSteps({ steps: { a: 0.02 * power }, measure, target: 1e-3, tries: 8 });
    assert.ok(found.error <= 1e-3 && found.error > 0.97e-3, `power ${power}: ${found.error} after ${measured}`);
    assert.equal(found.steps.a, found.a);
  }
  const hopeless = await fitSteps({ steps: { a: 1 }, measure: async ({ a }) => ({ error: 1 + a }), target: 0.5 });
  assert.ok(hopeless.steps.a < 0.05, 'the finest that were tried');
});

test('a scene is tuned until its rounding is what it may be, and without an encoder that is said', async () => {
  const cloud = ofKinds(2_000, 1, 40);
  const order = packedOrder(cloud);
  const measure = async (bytes: Uint8Array): Promise<number> => {
    const found = await read(bytes);
    let sum = 0;
    order.forEach((i, k) => {
      for (let n = 0; n < 12; n++) sum += (found.sh[12 * k + n] - cloud.sh[12 * i + n]) ** 2;
      for (let n = 0; n < 3; n++) {
        sum += (found.positions[3 * k + n] - cloud.positions[3 * i + n]) ** 2;
        sum += Math.log(found.scales[3 * k + n] / cloud.scales[3 * i + n]) ** 2;
      }
      sum += (found.opacities[k] - cloud.opacities[i]) ** 2;
    });
    return sum / order.length;
  };
  const whole = { cloud, degrees: new Uint8Array(cloud.count).fill(1) };
  const sizes: number[] = [];
  for (const target of [1e-2, 1e-3]) {
    const [{ tune }] = encodingsFor('a.sog', cloud, { encodeWebp });
    const bytes = await (await tune!(whole, measure, target)).write(whole);
    const error = await measure(bytes);
    assert.ok(error <= 1.2 * target && error > 0.2 * target, `${error}, not ${target}`);
    sizes.push(bytes.length);
  }
  assert.ok(sizes[0] < 0.92 * sizes[1], `${sizes}`);
  await assert.rejects(encodingsFor('a.sog')[0].tune!(whole, measure, 1e-3), { code: 'argument/value' });
});

/** Center and spread of a cloud's matter: each splat counts by its opacity and its volume's face. */
function matterOf({ count, positions, scales, opacities }: GaussianCloud): { area: number; center: number[] } {
  let area = 0;
  const center = [0, 0, 0];
  for (let i = 0; i < count; i++) {
    const [a, b, c] = [...scales.subarray(3 * i, 3 * i + 3)].sort((x, y) => y - x);
    const own = opacities[i] * a * (b + c);
    area += own;
    for (let axis = 0; axis < 3; axis++) center[axis] += own * positions[3 * i + axis];
  }
  return { area, center: center.map((sum) => sum / area) };
}

test('a streamed scene: the finest levels of all boxes are the scene, each coarser one has a quarter of the splats in the same place', async () => {
  const cloud = ofKinds(20_000, 1, 40);
  const files = await writeStreamedSog(cloud, { steps: FINEST, palette: 64, encodeWebp, effort: 0 });
  const index = files.get('lod-meta.json')!;
  const { boxes } = readLodScene(index, 'lod-meta.json', 'https://lod.test/lod-meta.json');
  const { length } = packedOrder(cloud);
  assert.equal(boxes.length, 2);
  const counts = boxes.map(({ runs }) => runs.map(({ count }) => count));
  assert.deepEqual(
    counts.map((own) => own.length),
    [4, 4],
  );
  assert.equal(
    counts.reduce((sum, own) => sum + own[3], 0),
    length,
  );
  for (const own of counts) {
    for (let level = 1; level < own.length; level++) assert.equal(own[level - 1], Math.ceil(own[level] / 4));
  }
  const openFile = async (path: string): Promise<Uint8Array> => files.get(path)!;
  const levelAt = (level: number): Promise<GaussianCloud> =>
    readScene(index, { name: 'lod-meta.json', openFile, level });
  const finest = await levelAt(0);
  const plain = await read(await writeSog(cloud, { steps: FINEST, palette: 64, encodeWebp, effort: 0 }));
  assert.equal(finest.count, plain.count);
  finest.positions.forEach((x, k) => assert.ok(Math.abs(x - plain.positions[k]) < 1e-3, `place ${k}`));
  const [whole, radius] = [matterOf(finest), Math.max(...cloud.positions)];
  for (const level of [1, 2, 3]) {
    const { area, center } = matterOf(await levelAt(level));
    console.log(`level ${level}: ${(area / whole.area).toFixed(2)} of the area`);
    assert.ok(area > 0.4 * whole.area && area < 2.5 * whole.area, `${area}, not ${whole.area}`);
    center.forEach((x, axis) => assert.ok(Math.abs(x - whole.center[axis]) < 0.1 * radius, `level ${level}`));
  }
});

test('asked for lod-meta.json, an archive is written that is read as the scene, and taken apart again', async () => {
  const cloud = ofKinds(1_000, 0, 40);
  const whole = { cloud, degrees: new Uint8Array(cloud.count) };
  const [{ tune }] = encodingsFor('folder/lod-meta.json', cloud, { encodeWebp });
  const bytes = await (await tune!(whole, async () => 1e-3, 1e-3)).write(whole);
  const found = await readScene(bytes, { name: 'lod-meta.json' });
  assert.equal(found.count, packedOrder(cloud).length);
  const files = filesOfZip(bytes);
  assert.equal([...files.keys()].at(-1), 'lod-meta.json', 'the index comes last');
  assert.ok(files.get('0_0/means_l.webp')!.length > 100);
  await assert.rejects(
    encodingsFor('lod-meta.json')[0].tune!(whole, async () => 1e-3, 1e-3),
    {
      code: 'argument/value',
    },
  );
});
