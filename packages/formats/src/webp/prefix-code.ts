import { type BitReader, WebpError } from './bits.js';

/** Maximum number of bits that index the root table of a code. Codes have up to 15 bits. */
export const ROOT_BITS = 9;
const MAX_LENGTH = 15;

/**
 * Decoding tables of a prefix code. The upper 24 bits of an entry are a symbol, and the lower 8 bits the length of its
 * code. With {@link LINK}, the upper bits are the start of a second table, which the next bits index.
 */
export interface PrefixCode {
  readonly table: Uint32Array;
  /** Number of bits that index the root table. */
  readonly rootBits: number;
}

/** Flag of an entry that refers to a second table. The lowest 4 bits are then the number of bits of its index. */
export const LINK = 0x80;

/** Symbols of the code for code lengths, in the order of their stored lengths. */
const LENGTH_ORDER = [17, 18, 0, 1, 2, 3, 4, 5, 16, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15];

/** Reads a prefix code of the symbols 0 to `alphabet` - 1. Throws {@link WebpError}. */
export function readPrefixCode(bits: BitReader, alphabet: number): PrefixCode {
  if (bits.read(1) === 1) return readSimple(bits, alphabet);
  const lengths = new Uint8Array(alphabet);
  readLengths(bits, lengths);
  return buildTables(lengths);
}

/** Reads a code of one or two symbols, whose tables do not depend on code lengths. */
function readSimple(bits: BitReader, alphabet: number): PrefixCode {
  const count = bits.read(1) + 1;
  const first = bits.read(bits.read(1) === 1 ? 8 : 1);
  const second = count === 2 ? bits.read(8) : first;
  const [low, high] = [Math.min(first, second), Math.max(first, second)];
  if (high >= alphabet) throw new WebpError('a symbol outside its alphabet');
  if (low === high) return { table: Uint32Array.of(low << 8), rootBits: 0 };
  return { table: Uint32Array.of((low << 8) | 1, (high << 8) | 1), rootBits: 1 };
}

function readLengths(bits: BitReader, lengths: Uint8Array): void {
  const codeLengths = new Uint8Array(LENGTH_ORDER.length);
  const stored = 4 + bits.read(4);
  for (let k = 0; k < stored; k++) codeLengths[LENGTH_ORDER[k]] = bits.read(3);
  const code = buildTables(codeLengths);
  let budget = lengths.length;
  if (bits.read(1) === 1) {
    budget = 2 + bits.read(2 + 2 * bits.read(3));
    if (budget > lengths.length) throw new WebpError('more code lengths than symbols');
  }
  let previous = 8;
  for (let symbol = 0; symbol < lengths.length && budget > 0; budget--) {
    const read = readSymbol(bits, code);
    if (read < 16) {
      lengths[symbol++] = read;
      if (read !== 0) previous = read;
      continue;
    }
    const repeats = read === 16 ? 3 + bits.read(2) : read === 17 ? 3 + bits.read(3) : 11 + bits.read(7);
    if (symbol + repeats > lengths.length) throw new WebpError('more code lengths than symbols');
    if (read === 16) lengths.fill(previous, symbol, symbol + repeats);
    symbol += repeats;
  }
}

/** Reads the next symbol of a code. This function is for headers; pixels have a faster loop. */
export function readSymbol(bits: BitReader, { table, rootBits }: PrefixCode): number {
  let ahead = 0;
  const start = bits.position;
  const peek = (count: number): number => {
    bits.position = start;
    ahead = Math.min(count, bits.length - start);
    return bits.read(ahead);
  };
  let entry = table[peek(rootBits)];
  let taken = 0;
  if ((entry & LINK) !== 0) {
    const second = entry & 15;
    entry = table[(entry >>> 8) + (peek(rootBits + second) >>> rootBits)];
    taken = rootBits;
  }
  bits.position = start;
  bits.read(taken + (entry & 15));
  return entry >>> 8;
}

/** Builds the canonical code of the given code lengths, 0 for unused symbols. A single symbol has a code of 0 bits. */
function buildTables(lengths: Uint8Array): PrefixCode {
  const counts = new Uint16Array(MAX_LENGTH + 1);
  let used = 0;
  let last = 0;
  for (let symbol = 0; symbol < lengths.length; symbol++) {
    if (lengths[symbol] === 0) continue;
    counts[lengths[symbol]]++;
    used++;
    last = symbol;
  }
  if (used === 0) throw new WebpError('a prefix code without symbols');
  if (used === 1) return { table: Uint32Array.of(last << 8), rootBits: 0 };
  const firstCode = firstCodes(counts);
  const longest = counts.findLastIndex((count) => count > 0);
  const rootBits = Math.min(ROOT_BITS, longest);
  const codes = new Uint16Array(lengths.length);
  for (let symbol = 0; symbol < lengths.length; symbol++) {
    if (lengths[symbol] > 0) codes[symbol] = reversed(firstCode[lengths[symbol]]++, lengths[symbol]);
  }
  return { table: fillTables(lengths, codes, rootBits), rootBits };
}

/** Returns the first code of each length. Throws if the code is not complete, because some bits would be undefined. */
function firstCodes(counts: Uint16Array): Uint16Array {
  const first = new Uint16Array(MAX_LENGTH + 2);
  let room = 1;
  for (let length = 1; length <= MAX_LENGTH; length++) {
    room = 2 * room - counts[length];
    if (room < 0) throw new WebpError('a prefix code with too many symbols');
    first[length + 1] = (first[length] + counts[length]) << 1;
  }
  if (room !== 0) throw new WebpError('a prefix code with gaps');
  return first;
}

function reversed(code: number, length: number): number {
  let result = 0;
  for (let bit = 0; bit < length; bit++) result |= ((code >>> bit) & 1) << (length - 1 - bit);
  return result;
}

function fillTables(lengths: Uint8Array, codes: Uint16Array, rootBits: number): Uint32Array {
  const rootSize = 1 << rootBits;
  /** For each index of the root table, number of bits of the second table; 0 without one. */
  const beyond = new Uint8Array(rootSize);
  lengths.forEach((length, symbol) => {
    const root = codes[symbol] & (rootSize - 1);
    if (length > rootBits) beyond[root] = Math.max(beyond[root], length - rootBits);
  });
  const starts = new Uint32Array(rootSize);
  let size = rootSize;
  beyond.forEach((bits, root) => {
    if (bits === 0) return;
    starts[root] = size;
    size += 1 << bits;
  });
  const table = new Uint32Array(size);
  beyond.forEach((bits, root) => {
    if (bits > 0) table[root] = (starts[root] << 8) | LINK | bits;
  });
  lengths.forEach((length, symbol) => {
    if (length === 0) return;
    const root = codes[symbol] & (rootSize - 1);
    if (length <= rootBits) {
      for (let at = codes[symbol]; at < rootSize; at += 1 << length) table[at] = (symbol << 8) | length;
    } else {
      const own = length - rootBits;
      const end = 1 << beyond[root];
      for (let at = codes[symbol] >>> rootBits; at < end; at += 1 << own) {
        table[starts[root] + at] = (symbol << 8) | own;
      }
    }
  });
  return table;
}
