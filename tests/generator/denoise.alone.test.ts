/**
 * The denoiser of demo/generators on five scenes that it has not seen: photographs of the studio, 512 x 512 pixels of each,
 * with the noise of its training. Alone, as `@jsquash/webp` sets the global `ImageData`.
 */
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { test } from 'node:test';
import * as ort from 'onnxruntime-web';
import { someOf } from '../support/extent.js';
import { seededRandom } from '../support/random.js';
import { studio, STUDIO } from '../support/studio.js';

const MODEL = new URL('../../demo/generators/denoise/model.onnx', import.meta.url);
const [SIDE, NOISE] = [512, 0.08];
/** Smallest gain in dB. Its own training has 7.3 dB on held-out images. */
const GAIN = 6;

/** Planes of the middle of an image of `width` columns, [height, width, 3]. */
function middleOf(image: Float32Array, width: number): Float32Array {
  const height = image.length / 3 / width;
  const [left, top] = [Math.floor((width - SIDE) / 2), Math.floor((height - SIDE) / 2)];
  assert.ok(left >= 0 && top >= 0, `an image of ${width} x ${height}`);
  return Float32Array.from({ length: 3 * SIDE * SIDE }, (_, i) => {
    const [channel, pixel] = [Math.floor(i / SIDE / SIDE), i % (SIDE * SIDE)];
    return image[3 * ((top + Math.floor(pixel / SIDE)) * width + left + (pixel % SIDE)) + channel];
  });
}

const decibels = (found: Float32Array, wanted: Float32Array): number =>
  -10 *
  Math.log10(
    found.reduce((sum, value, i) => sum + (Math.min(1, Math.max(0, value)) - wanted[i]) ** 2, 0) / wanted.length,
  );

for (const name of someOf(STUDIO, 1)) {
  test(`${name}: the denoiser gains ${GAIN} dB on a scene that it has not seen`, async () => {
    const { held, image } = await studio(name);
    const clean = middleOf(await image(held[0]), held[0].camera.width);
    const random = seededRandom(5);
    const noisy = clean.map((value) => Math.min(1, Math.max(0, value + NOISE * random.normal())));
    ort.env.logLevel = 'error';
    ort.env.wasm.numThreads = 1;
    const session = await ort.InferenceSession.create(readFileSync(MODEL), { executionProviders: ['wasm'] });
    const given = {
      image: new ort.Tensor('float32', noisy, [1, 3, SIDE, SIDE]),
      strength: new ort.Tensor('float32', [1], [1]),
    };
    const [{ data }] = Object.values(await session.run(given));
    await session.release();
    const [before, after] = [decibels(noisy, clean), decibels(data as Float32Array, clean)];
    console.log(`${name.padEnd(10)} ${before.toFixed(2)} dB, then ${after.toFixed(2)} dB`);
    assert.ok(after - before > GAIN, `${before} dB, then ${after} dB`);
  });
}
