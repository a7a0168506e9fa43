import type { GaussianCloud } from '@gaussian-splat/core';
import { sortByKey } from '@gaussian-splat/renderer/tools';

/**
 * Places of numbers from the least to the largest, of equal ones the last first: backwards it is from the largest, in their order. Numbers must not be negative: then they are in the order of their bits, and millions are
 * sorted digit by digit ten times faster than by comparison.
 */
export function ascendingOrder(values: Float32Array): Uint32Array {
  const bits = new Uint32Array(values.buffer, values.byteOffset, values.length);
  const last = bits.length - 1;
  const places = new Uint32Array(bits.length).map((_, k) => last - k);
  return sortByKey(places, bits.slice().reverse());
}

/** Numbers of half a word. */
const HALVES = 1 << 16;

/**
 * The numbers that would stand at some places if all were in ascending order, which takes a tenth of the time of putting them there. Numbers must not be negative. They are counted by the upper
 * halves of their bits, and those whose upper halves matter by the lower ones.
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

/** Which of the counted ones stands at a place, and at which place among those like it. */
function countedAt(counts: Uint32Array, place: number): { half: number; rest: number } {
  let [half, rest] = [0, place];
  while (rest >= counts[half]) rest -= counts[half++];
  return { half, rest };
}

/** The same splats, the most seen first: by contribution times the area of the splat. */
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

/** What {@link coarseToFine} makes of all splats of a cloud: a thread can do it before it is known which of them stay. */
export function orderAll({ scales, contribution }: { scales: Float32Array; contribution: Float32Array }): Uint32Array {
  return coarseToFine(
    { scales },
    contribution,
    new Uint32Array(contribution.length).map((_, i) => i),
  );
}

/** Those of an order of all splats that stay. */
export function stayingInOrder(order: Uint32Array, staying: Uint32Array): Uint32Array {
  const stays = new Uint8Array(order.length);
  for (let k = 0; k < staying.length; k++) stays[staying[k]] = 1;
  const kept = new Uint32Array(staying.length);
  let count = 0;
  for (let k = 0; k < order.length; k++) if (stays[order[k]] === 1) kept[count++] = order[k];
  return kept;
}
