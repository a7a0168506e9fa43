/** The difference between another result and rounding: the pure half of the comparison of a page's GPU with its CPU. */
import assert from 'node:assert/strict';
import test from 'node:test';
import type { AttributeSlice } from '@gaussian-splat/core/contract';
import { compareOutputs, isDifferent, type OutputDifference } from '@gaussian-splat/generator';

const ROWS = 2000;
const slice = (
  attribute: 'positions' | 'covariances' | 'opacities',
  offset: number,
  components: number,
): AttributeSlice => ({
  attribute,
  tensor: 'g',
  offset,
  components,
  rowStride: 10,
  activation: attribute === 'opacities' ? 'logit' : 'linear',
});
const SLICES = [slice('positions', 0, 3), slice('covariances', 3, 6), slice('opacities', 9, 1)];

/** Centers of some meters, covariances of a thousandth, logits. */
const rows = (): Float32Array =>
  Float32Array.from({ length: 10 * ROWS }, (_, i) => {
    const column = i % 10;
    return column < 3 ? 5 * Math.sin(i) : column < 9 ? 1e-3 * Math.abs(Math.cos(i)) : 30 * Math.sin(i);
  });

const part = (found: Float32Array, expected: Float32Array, start = 0): OutputDifference => ({
  tensor: 'g',
  dtype: 'float32',
  start,
  found: new Uint8Array(found.buffer, found.byteOffset, found.byteLength),
  expected: new Uint8Array(expected.buffer, expected.byteOffset, expected.byteLength),
});
const changed = (change: (value: number, i: number) => number): Float32Array => rows().map(change);

test('roundings, and a row that falls to the other side of a threshold, are no difference', () => {
  const rounded = compareOutputs(
    [
      part(
        changed((x) => x * (1 + 3e-4)),
        rows(),
      ),
    ],
    SLICES,
  );
  assert.ok(!isDifferent(rounded) && rounded.error < 1e-3, JSON.stringify(rounded));
  const flipped = compareOutputs(
    [
      part(
        changed((x, i) => (i < 10 ? 0 : x)),
        rows(),
      ),
    ],
    SLICES,
  );
  assert.ok(!isDifferent(flipped) && flipped.error > 0.1, JSON.stringify(flipped));
  // Both are opacity 1.
  const opaque = compareOutputs(
    [
      part(
        changed((x, i) => (i % 10 === 9 && x > 20 ? 2 * x : x)),
        rows(),
      ),
    ],
    SLICES,
  );
  assert.ok(!isDifferent(opaque), JSON.stringify(opaque));
});

test('covariances that are wrong are seen beside centers that are a thousand times larger, in a piece from the middle, too', () => {
  for (const start of [0, 7]) {
    const [found, expected] = [changed((x, i) => (i % 10 === 4 ? 1.5 * x : x)), rows()].map((all) => all.slice(start));
    const comparison = compareOutputs([part(found, expected, start)], SLICES);
    assert.ok(isDifferent(comparison), JSON.stringify(comparison));
    assert.equal(comparison.where, 'covariances');
  }
});

test('numbers that are none on one side alone are a difference, and on both are none', () => {
  const nan = changed((x, i) => (i % 10 === 0 ? NaN : x));
  assert.ok(isDifferent(compareOutputs([part(nan, rows())], SLICES)));
  assert.ok(!isDifferent(compareOutputs([part(nan, nan)], SLICES)));
});

test('an image is compared as a whole, float16 with a tolerance for its rounding', () => {
  const halves = (value: number): Uint8Array => new Uint8Array(new Uint16Array(64).fill(value).buffer);
  const image = (found: number, expected: number): OutputDifference => ({
    tensor: 'out',
    dtype: 'float16',
    start: 0,
    found: halves(found),
    expected: halves(expected),
  });
  // 1 and its neighbor; 1 and 1.5.
  assert.ok(!isDifferent(compareOutputs([image(0x3c01, 0x3c00)])));
  assert.ok(isDifferent(compareOutputs([image(0x3e00, 0x3c00)])));
});
