/** Numbers in their order, against comparison. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import {
  ascendingOrder,
  coarseToFine,
  orderAll,
  stayingInOrder,
  valuesAtPlaces,
} from '../../packages/optimize/src/order.js';
import { seededRandom } from '../support/random.js';

const random = seededRandom(5);
/** Tiny ones, zeros, many that are equal, some that differ in their last bits alone, and infinity. */
const values = Float32Array.from({ length: 5000 }, (_, i) => {
  if (i % 7 === 0) return 0;
  if (i % 11 === 0) return Infinity;
  if (i % 5 === 0) return 0.25 + (i % 3) * 2 ** -24;
  return 10 ** random.uniform(-44, 30);
});
const sorted = values.slice().sort();

test('the order of numbers is that of comparison', () => {
  assert.deepEqual(
    Array.from(ascendingOrder(values), (place) => values[place]),
    [...sorted],
  );
});

test('numbers at some places are those of all in order', () => {
  const places = [...sorted.keys()].filter((k) => k % 13 === 0 || k > 4990);
  assert.deepEqual(
    valuesAtPlaces(values, places),
    places.map((place) => sorted[place]),
  );
  assert.deepEqual(valuesAtPlaces(values, [4000, 2, 2]), [sorted[4000], sorted[2], sorted[2]]);
  assert.deepEqual(valuesAtPlaces(Float32Array.of(3), [0]), [3]);
});

test('splats that stay come in the same order whether they are put into it before or after', () => {
  const contribution = values.map((value) => Math.min(value, 1));
  const scales = Float32Array.from({ length: 3 * contribution.length }, (_, k) => 1 + (k % 4));
  const staying = Uint32Array.from([...contribution.keys()].filter((i) => i % 3 !== 1));
  const expected = coarseToFine({ scales }, contribution, staying);
  assert.deepEqual(stayingInOrder(orderAll({ scales, contribution }), staying), expected);
  assert.ok(expected.some((i, k) => i !== staying[k]));
});
