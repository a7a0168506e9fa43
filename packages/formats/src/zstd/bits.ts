/** A damaged or unreadable Zstandard stream; `byte` counts from the start of the stream. */
export class ZstdError extends Error {
  override readonly name = 'ZstdError';
  readonly byte: number;
  /** Whether the stream ends too early; false if its content is invalid. */
  readonly isCut: boolean;

  constructor(message: string, byte: number, isCut = false) {
    super(message);
    this.byte = byte;
    this.isCut = isCut;
  }
}

/** Position of the highest set bit of a positive integer below 2^32; 0 for 1. */
export function highestBit(value: number): number {
  return 31 - Math.clz32(value);
}

/**
 * Reads a bit stream from its end to its beginning, as in entropy-coded parts of Zstandard (RFC 8878, 4.1). Bits before
 * the beginning read as zeros and make {@link left} negative; callers check it if that is an error.
 */
export class BackwardBits {
  readonly #bytes: Uint8Array;
  readonly #start: number;
  /** Number of unread bits. */
  left: number;

  /** The stream is the bytes `start` to `end`; the highest set bit of the last one marks its end. */
  constructor(bytes: Uint8Array, start: number, end: number) {
    const last = end > start ? bytes[end - 1] : 0;
    if (last === 0) throw new ZstdError('a bit stream without an end mark', end);
    this.#bytes = bytes;
    this.#start = start;
    this.left = 8 * (end - start - 1) + highestBit(last);
  }

  /** Reads the next `count` bits, 0 to 31, first bit highest. */
  read(count: number): number {
    if (count > 16) return this.read(count - 16) * 65_536 + this.read(16);
    const bits = this.peek(count);
    this.left -= count;
    return bits;
  }

  /** Returns the next `count` bits, 0 to 16, without consuming them. */
  peek(count: number): number {
    const position = this.left - count;
    if (position < 0) return this.#beforeStart(count, -position);
    const at = this.#start + (position >>> 3);
    const bytes = this.#bytes;
    const word = bytes[at] | (bytes[at + 1] << 8) | (bytes[at + 2] << 16);
    return (word >>> (position & 7)) & ((1 << count) - 1);
  }

  #beforeStart(count: number, missing: number): number {
    if (missing >= count) return 0;
    const first = this.#bytes[this.#start] | (this.#bytes[this.#start + 1] << 8) | (this.#bytes[this.#start + 2] << 16);
    return (first & ((1 << (count - missing)) - 1)) << missing;
  }
}
