/**
 * Adaptive binary range coder. The encoder and the decoder have one interface, so that a model of data is written once
 * for both.
 */

/** Codes bits by adaptive contexts. An encoder returns the given bits; a decoder ignores them, and returns its own. */
export interface BitCoder {
  /** Codes a bit, 0 or 1, by a context. */
  bit(contexts: Contexts, context: number, bit: number): number;
  /** Codes the lowest `count` bits, 0 to 24, of a number that is evenly distributed. */
  plain(value: number, count: number): number;
}

const RANGE_MIN = 2 ** 24;
/** Shifts of the two rates at which a probability adapts. It adapts faster while it is new. */
const [FAST, SLOW] = [4, 7];
/** Numbers of a context: its probability of a 0 at both rates, and its age. */
const NUMBERS = 3;
/** Number of bits of a probability that divides a range. */
const BITS = 12;

/** Adaptive probabilities of bits. */
export class Contexts {
  readonly #numbers: Uint16Array;

  constructor(count: number) {
    this.#numbers = new Uint16Array(NUMBERS * count);
    for (let at = 0; at < this.#numbers.length; at += NUMBERS) this.#numbers.fill(2 ** 15, at, at + 2);
  }

  /** Returns the probability of a 0, 1 to 4095, in 4096ths. */
  ofZero(context: number): number {
    const at = NUMBERS * context;
    const sum = (this.#numbers[at] + this.#numbers[at + 1]) >>> (17 - BITS);
    return sum === 0 ? 1 : sum;
  }

  adapt(context: number, bit: number): void {
    const numbers = this.#numbers;
    const at = NUMBERS * context;
    const age = ++numbers[at + 2];
    if (age > SLOW) numbers[at + 2] = SLOW;
    const [fast, slow] = [age < FAST ? age : FAST, age < SLOW ? age : SLOW];
    if (bit === 0) {
      numbers[at] += (65_535 - numbers[at]) >> fast;
      numbers[at + 1] += (65_535 - numbers[at + 1]) >> slow;
    } else {
      numbers[at] -= numbers[at] >> fast;
      numbers[at + 1] -= numbers[at + 1] >> slow;
    }
  }
}

export class BitEncoder implements BitCoder {
  #bytes = new Uint8Array(4096);
  #length = 0;
  /** Lower end of the range; it may exceed 32 bits by a carry. */
  #low = 0;
  #range = 2 ** 32 - 1;
  /** The last byte, which a carry may still change, and the number of bytes of 255 after it. The first byte is 0. */
  #last = 0;
  #full = 0;

  bit(contexts: Contexts, context: number, bit: number): number {
    const bound = (this.#range >>> BITS) * contexts.ofZero(context);
    if (bit === 0) this.#range = bound;
    else {
      this.#low += bound;
      this.#range -= bound;
    }
    contexts.adapt(context, bit);
    while (this.#range < RANGE_MIN) this.#shift();
    return bit;
  }

  plain(value: number, count: number): number {
    for (let k = count - 1; k >= 0; k--) {
      this.#range = this.#range >>> 1;
      if ((value >>> k) & 1) this.#low += this.#range;
      while (this.#range < RANGE_MIN) this.#shift();
    }
    return value;
  }

  /** Ends the code, and returns its bytes. */
  finish(): Uint8Array<ArrayBuffer> {
    for (let k = 0; k < 5; k++) this.#shift();
    return this.#bytes.slice(1, this.#length);
  }

  #shift(): void {
    this.#range = (this.#range << 8) >>> 0;
    const carry = this.#low >= 2 ** 32 ? 1 : 0;
    const low = this.#low % 2 ** 32;
    if (low < 0xff000000 || carry === 1) {
      this.#put(this.#last + carry);
      for (; this.#full > 0; this.#full--) this.#put(255 + carry);
      this.#last = low >>> 24;
    } else this.#full++;
    this.#low = (low % RANGE_MIN) * 256;
  }

  #put(byte: number): void {
    if (this.#length === this.#bytes.length) {
      const larger = new Uint8Array(2 * this.#length);
      larger.set(this.#bytes);
      this.#bytes = larger;
    }
    this.#bytes[this.#length++] = byte;
  }
}

/** Number of bytes that a decoder holds ahead. */
const AHEAD = 4;

export class BitDecoder implements BitCoder {
  readonly #bytes: Uint8Array;
  #at = 0;
  #code = 0;
  #range = 2 ** 32 - 1;

  constructor(bytes: Uint8Array) {
    this.#bytes = bytes;
    for (let k = 0; k < AHEAD; k++) this.#code = (this.#code * 256 + this.#next()) >>> 0;
  }

  /** Number of bytes that were not read; negative if bytes beyond the end were read as 0. 0 after an intact code. */
  get left(): number {
    return this.#bytes.length - this.#at;
  }

  bit(contexts: Contexts, context: number): number {
    const bound = (this.#range >>> BITS) * contexts.ofZero(context);
    let bit = 0;
    if (this.#code < bound) this.#range = bound;
    else {
      this.#code -= bound;
      this.#range -= bound;
      bit = 1;
    }
    contexts.adapt(context, bit);
    while (this.#range < RANGE_MIN) this.#shift();
    return bit;
  }

  plain(_value: number, count: number): number {
    let value = 0;
    for (let k = 0; k < count; k++) {
      this.#range = this.#range >>> 1;
      const bit = this.#code >= this.#range ? 1 : 0;
      if (bit === 1) this.#code -= this.#range;
      value = 2 * value + bit;
      while (this.#range < RANGE_MIN) this.#shift();
    }
    return value;
  }

  #shift(): void {
    this.#range = (this.#range << 8) >>> 0;
    this.#code = ((this.#code << 8) | this.#next()) >>> 0;
  }

  #next(): number {
    const at = this.#at++;
    return at < this.#bytes.length ? this.#bytes[at] : 0;
  }
}
