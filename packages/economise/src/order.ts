const DIGIT_BITS = 11;
const DIGITS = 1 << DIGIT_BITS;
const SHIFTS = [0, DIGIT_BITS, 2 * DIGIT_BITS];

/** Numbers that move together: bits, and the place that they are from. */
interface Items {
  readonly keys: Uint32Array;
  readonly places: Uint32Array;
}

const itemsOf = (count: number): Items => ({ keys: new Uint32Array(count), places: new Uint32Array(count) });

/**
 * Places of numbers from the least to the largest, of equal ones the last first: backwards it is from the largest, in their order. Numbers must not be negative: then they are in the order of their bits, and millions are
 * sorted digit by digit ten times faster than by comparison.
 */
export function ascendingOrder(values: Float32Array): Uint32Array {
  const count = values.length;
  const bits = new Uint32Array(values.buffer, values.byteOffset, count);
  let [from, to] = [itemsOf(count), itemsOf(count)];
  for (let k = 0; k < count; k++) {
    from.keys[k] = bits[count - 1 - k];
    from.places[k] = count - 1 - k;
  }
  for (const shift of SHIFTS) {
    moveByDigit(from, to, shift);
    [from, to] = [to, from];
  }
  return from.places;
}

/** Puts items in the order of a digit, and of equal digits in the order that they had. */
function moveByDigit({ keys, places }: Items, { keys: keysOut, places: placesOut }: Items, shift: number): void {
  const starts = new Uint32Array(DIGITS + 1);
  for (let k = 0; k < keys.length; k++) starts[((keys[k] >>> shift) & (DIGITS - 1)) + 1]++;
  for (let digit = 0; digit < DIGITS; digit++) starts[digit + 1] += starts[digit];
  for (let k = 0; k < keys.length; k++) {
    const to = starts[(keys[k] >>> shift) & (DIGITS - 1)]++;
    keysOut[to] = keys[k];
    placesOut[to] = places[k];
  }
}
