/** Model of signed numbers for the range coder. */
import { Contexts, type BitCoder } from './range-coder.js';

/** Numbers of classes of a magnitude: for flags of zeros, and for sizes. */
const [NEAR_CLASSES, CLASSES] = [10, 60];
/** Maximum number of bits of a magnitude, less 1. */
const MAX_EXPONENT = 24;

/**
 * Returns the class of a magnitude: itself below 4, then two classes for each octave.
 * @param size 0 to 2^25.
 */
function classOf(size: number): number {
  if (size < 4) return size;
  const octave = 31 - Math.clz32(size);
  return 2 * octave + ((size >>> (octave - 1)) & 1);
}

/** Codes signed numbers whose magnitudes resemble those of their neighbors. */
export class NumberModel {
  readonly #zero = new Contexts(NEAR_CLASSES * NEAR_CLASSES);
  readonly #sign = new Contexts(9);
  readonly #exponent = new Contexts(CLASSES * (MAX_EXPONENT + 1));
  readonly #mantissa = new Contexts(3 * (MAX_EXPONENT + 1));

  /**
   * Codes a number, which it returns.
   * @param near Magnitude of neighbors in space. @param then Magnitude of neighbors in time.
   * @param signs Context of the sign, 0 to 8.
   */
  code(coder: BitCoder, value: number, near: number, then: number, signs: number): number {
    const [a, b] = [classOf(near), classOf(then)];
    const place = NEAR_CLASSES * (a < NEAR_CLASSES ? a : NEAR_CLASSES - 1) + (b < NEAR_CLASSES ? b : NEAR_CLASSES - 1);
    if (coder.bit(this.#zero, place, value === 0 ? 0 : 1) === 0) return 0;
    const isNegative = coder.bit(this.#sign, signs, value < 0 ? 1 : 0) === 1;
    const size = this.#size(coder, value < 0 ? -value : value, classOf((near + then) >>> 1));
    return isNegative ? -size : size;
  }

  /** Codes a magnitude of 1 or more: the number of its bits, then its bits from the highest on. */
  #size(coder: BitCoder, size: number, kind: number): number {
    const first = (MAX_EXPONENT + 1) * kind;
    const own = 31 - Math.clz32(size);
    let exponent = 0;
    while (exponent < MAX_EXPONENT && coder.bit(this.#exponent, first + exponent, own > exponent ? 1 : 0) === 1)
      exponent++;
    if (exponent === 0) return 1;
    const high = coder.bit(this.#mantissa, 3 * exponent, (size >>> (exponent - 1)) & 1);
    if (exponent === 1) return 2 + high;
    const rest = exponent - 2;
    const next = coder.bit(this.#mantissa, 3 * exponent + 1 + high, (size >>> rest) & 1);
    const low = rest > 0 ? coder.plain(size & ((1 << rest) - 1), rest) : 0;
    return ((4 + 2 * high + next) << rest) + low;
  }
}
