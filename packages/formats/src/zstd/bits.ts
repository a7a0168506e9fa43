/** Error of the Zstandard decoder. `byte` is the offset of the fault from the start of the stream. */
export class ZstdError extends Error {
  override readonly name = 'ZstdError';
  readonly byte: number;
  /** Whether the stream ends too early. If false, its content is invalid. */
  readonly isCut: boolean;

  constructor(message: string, byte: number, isCut = false) {
    super(message);
    this.byte = byte;
    this.isCut = isCut;
  }
}

/** Returns the position of the highest set bit of an integer, 1 to 2^32 - 1. The lowest bit has position 0. */
export function highestBit(value: number): number {
  return 31 - Math.clz32(value);
}

/**
 * Reader of a bit stream from its end to its beginning, as in entropy-coded parts of Zstandard (RFC 8878, 4.1). Bits
 * before the beginning are 0 and make {@link left} negative, which callers check.
 */
export class BackwardBits {
  readonly #bytes: Uint8Array;
  readonly #start: number;
  /** Number of unread bits. Negative if more bits than the stream has were read. */
  left: number;

  /** @param end Byte offset after the stream. The highest set bit of its last byte marks the end of the bits. */
  constructor(bytes: Uint8Array, start: number, end: number) {
    const last = end > start ? bytes[end - 1] : 0;
    if (last === 0) throw new ZstdError('a bit stream without an end mark', end);
    this.#bytes = bytes;
    this.#start = start;
    this.left = 8 * (end - start - 1) + highestBit(last);
  }

  /** Reads the next `count` bits, 0 to 31, as an unsigned integer; the first bit is the highest. */
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
