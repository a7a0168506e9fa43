import { decodeHuffmanStream, readHuffmanTable, type HuffmanTable } from './huffman.js';
import { ZstdError } from './bits.js';

/** Maximum content of a block in bytes, and of its literals. */
export const MAX_BLOCK = 131_072;

export interface Literals {
  readonly content: Uint8Array;
  /** Byte offset after the literals section. */
  readonly next: number;
  /** Prefix code that a later block may reuse; undefined if no block has described one. */
  readonly table: HuffmanTable | undefined;
}

/** Reads the literals section of a compressed block (RFC 8878, 3.1.1.3.1). @param previous Code of earlier blocks. */
export function readLiterals(
  bytes: Uint8Array,
  start: number,
  end: number,
  previous: HuffmanTable | undefined,
): Literals {
  const type = bytes[start] & 3;
  const format = (bytes[start] >> 2) & 3;
  return type < 2
    ? readPlainLiterals(bytes, start, end, type === 1, format, previous)
    : readCodedLiterals(bytes, start, end, type === 3, format, previous);
}

function readPlainLiterals(
  bytes: Uint8Array,
  start: number,
  end: number,
  isRepeated: boolean,
  format: number,
  table: HuffmanTable | undefined,
): Literals {
  const headerBytes = [1, 2, 1, 3][format];
  const header = littleEndian(bytes, start, headerBytes);
  const size = Math.floor(header / (headerBytes === 1 ? 8 : 16));
  const at = start + headerBytes;
  const next = at + (isRepeated ? 1 : size);
  if (next > end || size > MAX_BLOCK) throw new ZstdError('literals that overrun their block', start);
  const content = isRepeated ? new Uint8Array(size).fill(bytes[at]) : bytes.subarray(at, next);
  return { content, next, table };
}

function readCodedLiterals(
  bytes: Uint8Array,
  start: number,
  end: number,
  reusesTable: boolean,
  format: number,
  previous: HuffmanTable | undefined,
): Literals {
  const sizeBits = [10, 10, 14, 18][format];
  const headerBytes = [3, 3, 4, 5][format];
  const header = littleEndian(bytes, start, headerBytes);
  const size = Math.floor(header / 16) % 2 ** sizeBits;
  const codedSize = Math.floor(header / 2 ** (4 + sizeBits));
  let at = start + headerBytes;
  const next = at + codedSize;
  if (next > end || size > MAX_BLOCK) throw new ZstdError('literals that overrun their block', start);
  let table = previous;
  if (!reusesTable) ({ table, next: at } = readHuffmanTable(bytes, at, next));
  if (!table) throw new ZstdError('literals in a prefix code that no block has described', start);
  const content = new Uint8Array(size);
  if (format === 0) decodeHuffmanStream(table, bytes, at, next, content);
  else decodeFourStreams(table, bytes, at, next, content);
  return { content, next, table };
}

/** Decodes four streams with a quarter of the literals each. The sizes of the first three precede the streams. */
function decodeFourStreams(table: HuffmanTable, bytes: Uint8Array, start: number, end: number, out: Uint8Array): void {
  const quarter = (out.length + 3) >> 2;
  let at = start + 6;
  for (let k = 0; k < 4; k++) {
    const stop = k < 3 ? at + littleEndian(bytes, start + 2 * k, 2) : end;
    if (stop > end || at > stop || 3 * quarter > out.length) {
      throw new ZstdError('streams of literals that overrun their block', start);
    }
    decodeHuffmanStream(table, bytes, at, stop, out.subarray(k * quarter, k < 3 ? (k + 1) * quarter : out.length));
    at = stop;
  }
}

/** Returns a little-endian unsigned integer of `count` bytes, up to 6. Bytes after the end of the array are 0. */
export function littleEndian(bytes: Uint8Array, at: number, count: number): number {
  let value = 0;
  for (let i = count - 1; i >= 0; i--) value = value * 256 + (bytes[at + i] ?? 0);
  return value;
}
