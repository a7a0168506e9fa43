/** The mask for a scene that is on the GPU already: what stays, that it is what was there, and that a figure is kept. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import { boundsOf, type GaussianCloud } from '@gaussian-splat/core';
import { decibels, heaviest, LiveMask, meanSquare, parseEconomyGoal, viewsAround } from '@gaussian-splat/economise';
import { capture, GaussianBuffers, packGaussians, readPacked, Renderer, selectPacked } from '@gaussian-splat/renderer';
import { cloudOf, repeat } from '../support/clouds.js';
import { randomSource } from '../support/gpu.js';
import { serialDevice } from '../support/node-device.js';
import { cameraAt } from '../support/scenes.js';

const random = randomSource(11);
const small = { width: 64, height: 36 };

/** An opaque ball of 350 splats, and 150 within it that nobody sees. */
function ball(): GaussianCloud {
  const onSphere = (radius: number): [number, number, number] => {
    const [x, y, z] = [random() - 0.5, random() - 0.5, random() - 0.5];
    const scale = radius / Math.hypot(x, y, z);
    return [x * scale, y * scale, z * scale];
  };
  const splat = (radius: number, scale: number) => () => ({
    position: onSphere(radius),
    scale,
    opacity: 0.95,
    color: [random(), random(), random()] as [number, number, number],
    sh: Array.from({ length: 9 }, () => 0.2 * (random() - 0.5)),
  });
  return cloudOf([...repeat(350, splat(1, 0.15)), ...repeat(150, splat(0.2, 0.02))], 1);
}

test('the attribute: shares, figures, and what is neither', () => {
  for (const [text, goal] of [
    ['60%', { share: 0.6 }],
    [' 0.25 ', { share: 0.25 }],
    ['57db', { decibels: 57 }],
    ['42.5 dB', { decibels: 42.5 }],
    ['0db', null],
    ['100%', null],
    ['views', 'views'],
    ['few', null],
    ['', null],
    [null, null],
  ] as const) {
    assert.deepEqual(parseEconomyGoal(text), goal, String(text));
  }
});

test('the heaviest stay, ties by their order, and the weightless never', () => {
  const weights = Float32Array.of(0.5, 0, 0.25, 1, 0.25, 0.25, 0, 0.9);
  assert.deepEqual([...heaviest(weights, 3)], [0, 3, 7]);
  assert.deepEqual([...heaviest(weights, 5)], [0, 2, 3, 4, 7]);
  assert.deepEqual([...heaviest(weights, 8)], [0, 2, 3, 4, 5, 7]);
  const many = Float32Array.from({ length: 5000 }, () => random() ** 3);
  const kept = heaviest(many, 2000);
  const least = Math.min(...[...kept].map((slot) => many[slot]));
  const dropped = [...many.keys()].filter((slot) => !new Set(kept).has(slot));
  // Bins are as wide as a hundredth of a weight.
  assert.ok(dropped.every((slot) => many[slot] <= least * 1.01));
});

test('a scene read back is what was uploaded, and a part of it draws as a cloud of that part', async () => {
  const device = await serialDevice();
  const packed = packGaussians(ball());
  const gaussians = await GaussianBuffers.upload(device, packed);
  const read = await readPacked(device, gaussians);
  assert.deepEqual(read, packed);
  const camera = cameraAt([0, -0.5, -3], [0, 0, 0], small);
  const renderer = new Renderer(device);
  const all = Uint32Array.from({ length: packed.count }, (_, slot) => slot);
  const draw = async (slots: Uint32Array): Promise<Float32Array> => {
    const part = await GaussianBuffers.upload(device, await selectPacked(read, slots));
    const image = await capture(device, renderer, { gaussians: part, camera });
    part.destroy();
    return image;
  };
  assert.deepEqual(await draw(all), await capture(device, renderer, { gaussians, camera }), 'all of it');
  // Dropping what covers the ball shows what is inside: other pixels, so the part is a part.
  const odd = all.filter((slot) => slot % 2 === 1);
  const half = await draw(odd);
  assert.notDeepEqual(half, await draw(all));
  renderer.destroy();
  gaussians.destroy();
});

test('what no view sees goes first, and a figure is kept in views that had no say', async () => {
  const device = await serialDevice();
  const cloud = ball();
  const bounds = boundsOf(cloud);
  const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud));
  const mask = await LiveMask.of(device, gaussians, bounds, { viewSize: small, patienceMs: Infinity });
  const renderer = new Renderer(device);
  const views = viewsAround(bounds, 5, { ...small, seed: 9 });
  const expected: Float32Array[] = [];
  for (const camera of views) expected.push(await capture(device, renderer, { gaussians, camera }));
  const measure = async (packed: Parameters<typeof GaussianBuffers.upload>[1]): Promise<number> => {
    const part = await GaussianBuffers.upload(device, packed);
    const errors: number[] = [];
    for (const [k, camera] of views.entries()) {
      errors.push(meanSquare(await capture(device, renderer, { gaussians: part, camera }), expected[k]));
    }
    part.destroy();
    return decibels(errors.reduce((sum, error) => sum + error, 0) / errors.length);
  };
  const { packed } = await mask.masked({ share: 0.75 });
  assert.equal(packed.count, 375);
  const masked = await measure(packed);
  const everyFourth = Uint32Array.from({ length: 500 }, (_, slot) => slot).filter((slot) => slot % 4 !== 0);
  const blind = await measure(await selectPacked(mask.whole, everyFourth));
  console.log(`three quarters of the splats: ${masked.toFixed(1)} dB, of any ${blind.toFixed(1)} dB`);
  assert.ok(masked > 50 && masked > blind + 20, `${masked} dB, blindly ${blind} dB`);

  const kept = await mask.masked({ decibels: 45 });
  const found = await measure(kept.packed);
  console.log(
    `45 dB asked: ${kept.packed.count} splats, ${kept.decibels?.toFixed(1)} dB measured, ${found.toFixed(1)} dB in other views`,
  );
  assert.ok(kept.packed.count < 500 && kept.decibels !== null && kept.decibels >= 45, 'fewer splats at that figure');
  assert.ok(found > 42, `${found} dB in views of the test`);
  const signal = AbortSignal.abort(new Error('over'));
  await assert.rejects(mask.masked({ decibels: 45 }, signal), /over/);
  renderer.destroy();
  gaussians.destroy();
});

// Dawn keeps Node alive.
after(() => {
  setImmediate(() => process.exit());
});
