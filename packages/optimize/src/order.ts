import type { GaussianCloud } from '@gaussian-splat/core';
import { sortByKey } from '@gaussian-splat/renderer/tools';

/**
 * Returns the indices of values in ascending order. Of equal values the last comes first, so that the reversed order is a
 * stable descending one. Values must not be negative, so that a radix sort of their bits has the same order. A radix sort
 * of millions is ten times as fast as comparisons.
 */
export function ascendingOrder(values: Float32Array): Uint32Array {
  const bits = new Uint32Array(values.buffer, values.byteOffset, values.length);
  const last = bits.length - 1;
  const places = new Uint32Array(bits.length).map((_, k) => last - k);
  return sortByKey(places, bits.slice().reverse());
}

/** Number of values of a half of 32 bits. */
const HALVES = 1 << 16;

/**
 * Returns order statistics: the values at some positions of the ascending order, in a tenth of the time of sorting. Values
 * must not be negative. One histogram counts the upper halves of their bits, and further ones the lower halves of
 * candidates.
 */
export function valuesAtPlaces(values: Float32Array, places: readonly number[]): number[] {
  const bits = new Uint32Array(values.buffer, values.byteOffset, values.length);
  const uppers = new Uint32Array(HALVES);
  for (let k = 0; k < bits.length; k++) uppers[bits[k] >>> 16]++;
  const found = places.map((place) => countedAt(uppers, place));
  const rows = new Int32Array(HALVES).fill(-1);
  let length = 0;
  for (const { half } of found) {
    if (rows[half] >= 0) continue;
    rows[half] = length;
    length += HALVES;
  }
  const lowers = new Uint32Array(length);
  for (let k = 0; k < bits.length; k++) {
    const row = rows[bits[k] >>> 16];
    if (row >= 0) lowers[row + (bits[k] & (HALVES - 1))]++;
  }
  const words = Uint32Array.from(found, ({ half, rest }) => {
    const row = rows[half];
    return half * HALVES + countedAt(lowers.subarray(row, row + HALVES), rest).half;
  });
  return [...new Float32Array(words.buffer)];
}

/** Returns the bin of a histogram at a position of the order (`half`), and the position within the bin (`rest`). */
function countedAt(counts: Uint32Array, place: number): { half: number; rest: number } {
  let [half, rest] = [0, place];
  while (rest >= counts[half]) rest -= counts[half++];
  return { half, rest };
}

/** Returns the indices `splats` by descending visibility, which is the contribution of a splat times its area. */
export function coarseToFine(
  { scales }: Pick<GaussianCloud, 'scales'>,
  contribution: Float32Array,
  splats: Uint32Array,
): Uint32Array {
  const importance = new Float32Array(splats.length);
  for (let k = 0; k < splats.length; k++) {
    const i = splats[k];
    const a = scales[3 * i];
    const b = scales[3 * i + 1];
    const c = scales[3 * i + 2];
    importance[k] = contribution[i] * Math.max(a * b, b * c, c * a);
  }
  const order = ascendingOrder(importance).reverse();
  for (let k = 0; k < order.length; k++) order[k] = splats[order[k]];
  return order;
}

/** Returns the order of {@link coarseToFine} for all splats of a cloud. A thread can run it before the cut is known. */
export function orderAll({ scales, contribution }: { scales: Float32Array; contribution: Float32Array }): Uint32Array {
  return coarseToFine(
    { scales },
    contribution,
    new Uint32Array(contribution.length).map((_, i) => i),
  );
}

/** Returns the indices `staying` in the order that they have in `order`, an order of all splats. */
export function stayingInOrder(order: Uint32Array, staying: Uint32Array): Uint32Array {
  const stays = new Uint8Array(order.length);
  for (let k = 0; k < staying.length; k++) stays[staying[k]] = 1;
  const kept = new Uint32Array(staying.length);
  let count = 0;
  for (let k = 0; k < order.length; k++) if (stays[order[k]] === 1) kept[count++] = order[k];
  return kept;
}
