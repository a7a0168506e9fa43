/** Error of a WebP decoder. The caller converts it to a GaussianSplatError with the name of the file. */
export class WebpError extends Error {
  /** Whether the file is truncated. */
  readonly isCut: boolean;
  /** Whether the file may be valid, but is of an unsupported kind. */
  readonly isForeign: boolean;

  constructor(found: string, kind: 'damaged' | 'cut' | 'foreign' = 'damaged') {
    super(found);
    this.isCut = kind === 'cut';
    this.isForeign = kind === 'foreign';
  }
}

/** Number of zero bytes after the stream, so that a 32-bit read at its end is within the array. */
const PADDING = 8;

/** Reader of a bit stream, least significant bit first. */
export class BitReader {
  readonly bytes: Uint8Array;
  /** Number of bits that have been read. The inner loop of the decoder reads without {@link read} and sets it. */
  position = 0;
  /** Number of bits of the stream. */
  readonly length: number;

  /** Charges bytes before they are allocated; may throw. */
  readonly take: (bytes: number) => void;

  constructor(stream: Uint8Array, take: (bytes: number) => void) {
    this.take = take;
    this.bytes = new Uint8Array(stream.length + PADDING);
    this.bytes.set(stream);
    this.length = 8 * stream.length;
  }

  /** Reads the next `count` bits, 0 to 24, as an unsigned integer. Throws {@link WebpError} at the end of the stream. */
  read(count: number): number {
    const value = window32(this.bytes, this.position) & ((1 << count) - 1);
    this.position += count;
    if (this.position > this.length) throw cut();
    return value;
  }
}

/** Returns at least 25 bits from a bit position on, the first bit lowest. Bits after the end of the stream are 0. */
export function window32(bytes: Uint8Array, position: number): number {
  const at = position >>> 3;
  return (bytes[at] | (bytes[at + 1] << 8) | (bytes[at + 2] << 16) | (bytes[at + 3] << 24)) >>> (position & 7);
}

export function cut(): WebpError {
  return new WebpError('an image that is cut', 'cut');
}
