/** The range coder of clips, and the rotation of harmonics. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import type { Matrix3 } from '@gaussian-splat/core';
import { LoadBudget } from '@gaussian-splat/formats';
import { NO_PLANES, PlaneModel, type KnownSplats } from '../../packages/formats/src/clip/code-planes.js';
import { CODED_MARK, readCodedMotion } from '../../packages/formats/src/clip/coded-motion.js';
import { BitDecoder, BitEncoder, Contexts } from '../../packages/formats/src/clip/range-coder.js';
import { HarmonicsTurner } from '../../packages/formats/src/clip/turn-harmonics.js';
import type { Motion } from '../../packages/formats/src/motion.js';
import { shRotation } from '../../packages/formats/src/transform/sh-rotation.js';
import { seededRandom } from '../support/random.js';

test('bits return, likely ones cost almost nothing, and no byte is left or missing', () => {
  for (const [share, maxBytes] of [
    [0, 80],
    [0.01, 450],
    [0.5, 2600],
    [1, 80],
  ] as const) {
    const random = seededRandom(3);
    const bits = Array.from({ length: 20_000 }, () => (random.uniform(0, 1) < share ? 1 : 0));
    const encoder = new BitEncoder();
    const contexts = new Contexts(1);
    bits.forEach((bit, i) => {
      encoder.bit(contexts, 0, bit);
      if (i % 1000 === 0) encoder.plain(i, 20);
    });
    const bytes = encoder.finish();
    assert.ok(bytes.length < maxBytes, `${bytes.length} bytes for a probability of ${share}`);
    const decoder = new BitDecoder(bytes);
    const own = new Contexts(1);
    bits.forEach((bit, i) => {
      assert.equal(decoder.bit(own, 0), bit);
      if (i % 1000 === 0) assert.equal(decoder.plain(0, 20), i);
    });
    assert.equal(decoder.left, 0);
  }
});

/** Codes planes of 2,000 splats, asserts that they return, and returns their number of bytes. */
function bytesOf(codeOf: (place: readonly number[], i: number) => number, isPredicted: boolean): number {
  const random = seededRandom(8);
  const count = 2000;
  const places = Float64Array.from({ length: 3 * count }, () => random.uniform(-4, 4));
  const plane = Int16Array.from({ length: count }, (_, i) => codeOf([...places.subarray(3 * i, 3 * i + 3)], i));
  const known = (): KnownSplats => ({
    kinds: Uint8Array.from({ length: count }, (_, i) => (i % 7 === 0 ? 1 : 0)),
    places,
    isActive: new Uint8Array(count),
  });
  const encoder = new BitEncoder();
  const model = new PlaneModel(known());
  const second = plane.map((code) => -code >> 1);
  model.code(encoder, plane.slice(), NO_PLANES, isPredicted);
  model.code(encoder, second.slice(), { number: plane, curve: NO_PLANES.curve }, isPredicted);
  const bytes = encoder.finish();
  const decoder = new BitDecoder(bytes);
  const reader = new PlaneModel(known());
  const [first, next] = [new Int16Array(count), new Int16Array(count)];
  reader.code(decoder, first, NO_PLANES, isPredicted);
  reader.code(decoder, next, { number: first, curve: NO_PLANES.curve }, isPredicted);
  assert.deepEqual([first, next], [plane, second]);
  assert.equal(decoder.left, 0);
  return bytes.length;
}

test('codes return, also the largest; those of a rigid motion are predicted from positions', () => {
  const random = seededRandom(4);
  bytesOf(() => Math.round(random.uniform(-32_768, 32_767)), true);
  bytesOf((_, i) => (i % 2 === 0 ? -32_768 : 32_767), true);
  bytesOf((_, i) => (i % 2 === 0 ? -32_768 : 32_767), false);
  const rigid = ([x, y, z]: readonly number[]): number => Math.round(50 * x - 80 * y + 20 * z + 10);
  const [plain, predicted] = [bytesOf(rigid, false), bytesOf(rigid, true)];
  assert.ok(predicted < 0.4 * plain, `${predicted} of ${plain} bytes`);
  assert.ok(bytesOf(() => 0, false) < 20, 'zeros');
});

test('harmonics turn by a quaternion as by its matrix', () => {
  const random = seededRandom(6);
  const quaternions = [
    [1, 0, 0, 0],
    [0, 1, 0, 0],
    [0, 0, 1, 0],
    [0, 0, 0, 1],
    [Math.SQRT1_2, 0, 0, Math.SQRT1_2],
  ];
  for (let k = 0; k < 20; k++) quaternions.push([...random.rotation()]);
  for (const [w, x, y, z] of quaternions) {
    const turn: Matrix3 = [
      ...[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
      ...[2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
      ...[2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ] as unknown as Matrix3;
    const sh = Float32Array.from({ length: 48 }, () => random.uniform(-1, 1));
    const turned = sh.slice();
    new HarmonicsTurner(3).turn(turned, 0, [w, x, y, z]);
    assert.deepEqual([...turned.subarray(0, 3)], [...sh.subarray(0, 3)]);
    for (const [band, first] of [
      [1, 1],
      [2, 4],
      [3, 9],
    ] as const) {
      const matrix = shRotation(band, turn);
      const size = 2 * band + 1;
      for (let row = 0; row < size; row++)
        for (let channel = 0; channel < 3; channel++) {
          let expected = 0;
          for (let k = 0; k < size; k++) expected += matrix[size * row + k] * sh[3 * (first + k) + channel];
          assert.ok(Math.abs(turned[3 * (first + row) + channel] - expected) < 1e-5, `band ${band}, row ${row}`);
        }
    }
  }
});

test('codes that take no bytes are charged for the work of a decoder, and end with the file', () => {
  const read = (splats: number, frames: number): Motion => {
    const bytes = new Uint8Array(52 + 64).fill(77);
    const view = new DataView(bytes.buffer);
    bytes.fill(0, 0, 52);
    bytes.set([CODED_MARK, 4]);
    view.setUint32(4, splats, true);
    view.setUint32(8, frames, true);
    for (let k = 0; k < 5; k++) {
      view.setUint16(12 + 8 * k, frames, true);
      view.setFloat32(16 + 8 * k, 0.01, true);
    }
    const cloud = { count: splats, positions: new Float32Array(3 * splats) };
    return readCodedMotion({ bytes, name: 'm', frames, budget: new LoadBudget(1_000), cloud });
  };
  assert.throws(() => read(70_000, 30), { code: 'out-of-memory/budget' });
  assert.throws(() => read(20_000, 32), { code: 'decode/truncated' });
});
