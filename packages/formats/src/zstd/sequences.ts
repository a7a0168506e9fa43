import { BackwardBits, ZstdError } from './bits.js';
import { buildFseTable, readFseTable, singleSymbolTable, type FseTable } from './fse.js';

/** Tables of literal lengths, offsets and match lengths, in the order of the description in a block. */
export type SequenceTables = readonly [FseTable, FseTable, FseTable];

const range = (length: number, value: (k: number) => number): number[] => Array.from({ length }, (_, k) => value(k));

/** Number of additional bits of each code of literal lengths and match lengths (RFC 8878, 3.1.1.3.2.1). */
const LITERAL_BITS = [...range(16, () => 0), 1, 1, 1, 1, 2, 2, 3, 3, 4, ...range(11, (k) => k + 6)];
const MATCH_BITS = [...range(32, () => 0), 1, 1, 1, 1, 2, 2, 3, 3, 4, 4, 5, ...range(10, (k) => k + 7)];
/** Base value of each code; its additional bits are added. */
const LITERAL_BASE = baseValues(LITERAL_BITS, 0);
const MATCH_BASE = baseValues(MATCH_BITS, 3);

function baseValues(bits: readonly number[], first: number): number[] {
  let value = first;
  return bits.map((count) => {
    const base = value;
    value += 2 ** count;
    return base;
  });
}

/** Limits and predefined tables of the codes, in the order of {@link SequenceTables}. */
const CODES = [
  {
    limits: { maxAccuracyLog: 9, maxSymbol: 35 },
    predefined: buildFseTable(
      [4, 3, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 1, 1, 1, 2, 2, 2, 2, 2, 2, 2, 2, 2, 3, 2, 1, 1, 1, 1, 1, -1, -1, -1, -1],
      6,
    ),
  },
  {
    limits: { maxAccuracyLog: 8, maxSymbol: 31 },
    predefined: buildFseTable(
      [1, 1, 1, 1, 1, 1, 2, 2, 2, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, -1, -1, -1, -1, -1],
      5,
    ),
  },
  {
    limits: { maxAccuracyLog: 9, maxSymbol: 52 },
    predefined: buildFseTable([1, 4, 3, 2, 2, 2, 2, 2, 2, ...range(37, () => 1), -1, -1, -1, -1, -1, -1, -1], 6),
  },
] as const;

/** Destination of decoded content. `position` is the offset of the next byte. */
export interface Output {
  readonly bytes: Uint8Array;
  /** Offset in `bytes` of the start of the frame. Matches cannot refer to earlier bytes. */
  frameStart: number;
  position: number;
  readonly repeatedOffsets: [number, number, number];
}

/**
 * Executes the sequences section of a block: copies literals and matches to the output.
 * @param previous Tables of earlier blocks.
 * @returns Tables that a later block may reuse.
 */
export function executeSequences(
  bytes: Uint8Array,
  start: number,
  end: number,
  literals: Uint8Array,
  output: Output,
  previous: SequenceTables | undefined,
): SequenceTables | undefined {
  const { count, next } = readCount(bytes, start, end);
  if (count === 0) {
    if (next !== end) throw new ZstdError('bytes after the last sequence', next);
    copyLiterals(literals, 0, literals.length, output, start);
    return previous;
  }
  const { tables, next: bitsStart } = readTables(bytes, next, end, previous);
  const used = runSequences(new BackwardBits(bytes, bitsStart, end), count, tables, literals, output, start);
  copyLiterals(literals, used, literals.length, output, start);
  return tables;
}

function readCount(bytes: Uint8Array, start: number, end: number): { count: number; next: number } {
  const first = bytes[start];
  const size = first < 128 ? 1 : first < 255 ? 2 : 3;
  if (start + size > end) throw new ZstdError('a block that ends before its sequences', start);
  if (size === 1) return { count: first, next: start + 1 };
  if (size === 2) return { count: (first - 128) * 256 + bytes[start + 1], next: start + 2 };
  return { count: bytes[start + 1] + 256 * bytes[start + 2] + 0x7f00, next: start + 3 };
}

function readTables(
  bytes: Uint8Array,
  start: number,
  end: number,
  previous: SequenceTables | undefined,
): { tables: SequenceTables; next: number } {
  const modes = start < end ? bytes[start] : 3;
  if ((modes & 3) !== 0) throw new ZstdError('reserved bits that are set', start);
  let at = start + 1;
  const tables = CODES.map(({ limits, predefined }, k) => {
    const mode = (modes >> (6 - 2 * k)) & 3;
    if (mode === 0) return predefined;
    if (mode === 1) {
      if (at >= end || bytes[at] > limits.maxSymbol) throw new ZstdError('a code out of range', at);
      return singleSymbolTable(bytes[at++]);
    }
    if (mode === 2) {
      const { table, next } = readFseTable(bytes, at, end, limits);
      at = next;
      return table;
    }
    if (!previous) throw new ZstdError('codes that no block has described', at);
    return previous[k];
  });
  return { tables: [tables[0], tables[1], tables[2]], next: at };
}

/** Copies literals and matches alternately. Returns the number of literals that were copied. */
function runSequences(
  bits: BackwardBits,
  count: number,
  [literalTable, offsetTable, matchTable]: SequenceTables,
  literals: Uint8Array,
  output: Output,
  at: number,
): number {
  let literalState = bits.read(literalTable.accuracyLog);
  let offsetState = bits.read(offsetTable.accuracyLog);
  let matchState = bits.read(matchTable.accuracyLog);
  let used = 0;
  for (let remaining = count; remaining > 0; remaining--) {
    const offsetCode = offsetTable.symbols[offsetState];
    const offsetValue = 2 ** offsetCode + bits.read(offsetCode);
    const matchCode = matchTable.symbols[matchState];
    const matchLength = MATCH_BASE[matchCode] + bits.read(MATCH_BITS[matchCode]);
    const literalCode = literalTable.symbols[literalState];
    const literalLength = LITERAL_BASE[literalCode] + bits.read(LITERAL_BITS[literalCode]);
    if (remaining > 1) {
      literalState = literalTable.baselines[literalState] + bits.read(literalTable.bits[literalState]);
      matchState = matchTable.baselines[matchState] + bits.read(matchTable.bits[matchState]);
      offsetState = offsetTable.baselines[offsetState] + bits.read(offsetTable.bits[offsetState]);
    }
    if (bits.left < 0) throw new ZstdError('sequences that need more bits than there are', at);
    copyLiterals(literals, used, used + literalLength, output, at);
    used += literalLength;
    copyMatch(output, nextOffset(output.repeatedOffsets, offsetValue, literalLength), matchLength, at);
  }
  if (bits.left !== 0) throw new ZstdError('bits left over after the last sequence', at);
  return used;
}

/** Returns the offset of a match, which may be one of the last three (RFC 8878, 3.1.1.5), and updates `recent`. */
function nextOffset(recent: Output['repeatedOffsets'], value: number, literalLength: number): number {
  const index = value > 3 ? 3 : value - (literalLength === 0 ? 0 : 1);
  const offset = value > 3 ? value - 3 : index === 3 ? recent[0] - 1 : recent[index];
  if (index >= 2) recent[2] = recent[1];
  if (index >= 1) recent[1] = recent[0];
  recent[0] = offset;
  return offset;
}

function copyLiterals(literals: Uint8Array, from: number, to: number, output: Output, at: number): void {
  if (to > literals.length || output.position + to - from > output.bytes.length) {
    throw new ZstdError('more content than announced', at);
  }
  if (to - from < 32) {
    for (let i = from; i < to; i++) output.bytes[output.position++] = literals[i];
  } else {
    output.bytes.set(literals.subarray(from, to), output.position);
    output.position += to - from;
  }
}

/** Copies `length` bytes that begin `offset` bytes before the position. The ranges may overlap. */
function copyMatch(output: Output, offset: number, length: number, at: number): void {
  const { bytes, position, frameStart } = output;
  if (offset < 1 || offset > position - frameStart) throw new ZstdError('a match that begins before the content', at);
  if (position + length > bytes.length) throw new ZstdError('more content than announced', at);
  if (offset >= length && length > 32) bytes.copyWithin(position, position - offset, position - offset + length);
  else for (let i = position; i < position + length; i++) bytes[i] = bytes[i - offset];
  output.position = position + length;
}
