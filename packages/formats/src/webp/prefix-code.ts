import { type BitReader, WebpError } from './bits.js';

/** Bits of the root table's index; codes are up to 15 bits long. */
export const ROOT_BITS = 9;
const MAX_LENGTH = 15;

/**
 * A prefix code as tables. Entry: symbol or start of a second table in the upper bits, in the lower 8 the number of
 * bits to consume, and {@link LINK} if a second table follows.
 */
export interface PrefixCode {
  readonly table: Uint32Array;
  /** Bits that index the first table. */
  readonly rootBits: number;
}

/** Set if the entry refers to a second table; the other low bits are then the bits of its index. */
export const LINK = 0x80;

/** Storage order of the code lengths of the length code. */
const LENGTH_ORDER = [17, 18, 0, 1, 2, 3, 4, 5, 16, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15];

/** Reads one prefix code over `alphabet` symbols. */
export function readPrefixCode(bits: BitReader, alphabet: number): PrefixCode {
  if (bits.read(1) === 1) return readSimple(bits, alphabet);
  const lengths = new Uint8Array(alphabet);
  readLengths(bits, lengths);
  return buildTables(lengths);
}

/** One or two explicit symbols: their code needs no lengths, which would cost hundreds of steps for 4 bits. */
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

/** Reads the next symbol, without optimization, for headers. */
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

/** Canonical codes of the given lengths, 0 for unused symbols. A single symbol takes no bits. */
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

/** The first code of each length; a code must be complete, because otherwise some bits would be undefined. */
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
  /** Bits beyond the root table of the longest code with each root prefix. */
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
