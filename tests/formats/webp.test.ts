/** The decoder of lossless WebP: round trips through a plain writer here, real images against Chromium in browser/webp.test.ts. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { WebpError } from '../../packages/formats/dist/webp/bits.js';
import { decodeWebp } from '../../packages/formats/dist/webp/decode.js';
import { seededRandom } from '../support/random.js';
import { writeWebp } from './support/webp-writer.js';

test('every byte of every channel comes back, below alpha 0 too', () => {
  const random = seededRandom(3);
  for (const [width, height] of [
    [1, 1],
    [7, 5],
    [64, 33],
  ]) {
    const rgba = Uint8Array.from({ length: 4 * width * height }, () => random.uniform(0, 256));
    const image = decodeWebp(writeWebp(rgba, width, height));
    assert.deepEqual([image.width, image.height], [width, height]);
    const found = Array.from(image.pixels, (p) => [(p >>> 16) & 255, (p >>> 8) & 255, p & 255, p >>> 24]).flat();
    assert.deepEqual(found, Array.from(rgba));
  }
});

test('a cut image is said to be cut', () => {
  const file = writeWebp(new Uint8Array(4 * 8 * 8).fill(77), 8, 8);
  for (let length = 0; length < file.length - 1; length++) {
    assert.throws(() => decodeWebp(file.subarray(0, length)), WebpError, `${length} of ${file.length} bytes`);
  }
});
