/** A fault in a WebP file; the caller adds the file's name and converts it to an error for users. */
export class WebpError extends Error {
  /** Whether the file may only be truncated. */
  readonly isCut: boolean;
  /** Whether the file is valid but of an unsupported kind. */
  readonly isForeign: boolean;

  constructor(found: string, kind: 'damaged' | 'cut' | 'foreign' = 'damaged') {
    super(found);
    this.isCut = kind === 'cut';
    this.isForeign = kind === 'foreign';
  }
}

/** Zeros after the stream, so that a 32-bit read at its end stays within the array. */
const PADDING = 8;

/** Reads bits, least significant first. */
export class BitReader {
  readonly bytes: Uint8Array;
  /** Number of bits read. The decoder's inner loop keeps a local copy and writes it back. */
  position = 0;
  /** Bits of the stream. */
  readonly length: number;

  /** Charges bytes before they are allocated. */
  readonly take: (bytes: number) => void;

  constructor(stream: Uint8Array, take: (bytes: number) => void) {
    this.take = take;
    this.bytes = new Uint8Array(stream.length + PADDING);
    this.bytes.set(stream);
    this.length = 8 * stream.length;
  }

  /** The next `count` bits, 0 to 24, as a number. */
  read(count: number): number {
    const value = window32(this.bytes, this.position) & ((1 << count) - 1);
    this.position += count;
    if (this.position > this.length) throw cut();
    return value;
  }
}

/** At least 25 bits from a bit position on, padded with zeros beyond the end. */
export function window32(bytes: Uint8Array, position: number): number {
  const at = position >>> 3;
  return (bytes[at] | (bytes[at + 1] << 8) | (bytes[at + 2] << 16) | (bytes[at + 3] << 24)) >>> (position & 7);
}

export function cut(): WebpError {
  return new WebpError('an image that is cut', 'cut');
}
