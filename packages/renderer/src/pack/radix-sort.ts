const DIGIT_BITS = 11;
const DIGITS = 1 << DIGIT_BITS;

interface Items {
  readonly values: Uint32Array;
  readonly keys: Uint32Array;
}

const itemsOf = (count: number): Items => ({ values: new Uint32Array(count), keys: new Uint32Array(count) });

/**
 * Returns values in ascending order of their keys; values with equal keys keep their order. Radix sort with 11 bits in
 * each pass. The arguments are not modified.
 * @param keyBits Number of low bits that keys have; higher bits are 0.
 */
export function sortByKey(values: Uint32Array, keys: Uint32Array, keyBits = 32): Uint32Array {
  let from: Items = { values, keys };
  let to = itemsOf(values.length);
  let other = itemsOf(values.length);
  for (let shift = 0; shift < keyBits; shift += DIGIT_BITS) {
    moveByDigit(from, to, shift);
    [from, to, other] = [to, other, to];
  }
  return from.values;
}

/** Moves items to `to` in the order of one digit of their keys; the sort is stable. */
function moveByDigit({ values, keys }: Items, to: Items, shift: number): void {
  const starts = new Uint32Array(DIGITS + 1);
  for (const key of keys) starts[((key >>> shift) & (DIGITS - 1)) + 1]++;
  for (let digit = 0; digit < DIGITS; digit++) starts[digit + 1] += starts[digit];
  for (let k = 0; k < keys.length; k++) {
    const place = starts[(keys[k] >>> shift) & (DIGITS - 1)]++;
    to.keys[place] = keys[k];
    to.values[place] = values[k];
  }
}
