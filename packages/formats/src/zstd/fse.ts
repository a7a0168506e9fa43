import { highestBit, ZstdError } from './bits.js';

/** Decoding table of a finite-state entropy code (RFC 8878, 4.1). Each array is indexed by the state. */
export interface FseTable {
  /** Binary logarithm of the number of states. */
  readonly accuracyLog: number;
  /** Symbol of each state. */
  readonly symbols: Uint8Array;
  /** Number of bits to read for the next state. */
  readonly bits: Uint8Array;
  /** Value that is added to the read bits to get the next state. */
  readonly baselines: Uint16Array;
}

/** Returns the table of a code with a single symbol, which consumes no bits. */
export function singleSymbolTable(symbol: number): FseTable {
  return { accuracyLog: 0, symbols: Uint8Array.of(symbol), bits: new Uint8Array(1), baselines: new Uint16Array(1) };
}

/**
 * Builds the table of a distribution over 2^accuracyLog states. Probabilities are numbers of states, whose sum must be
 * 2^accuracyLog. Probability -1 means "less than 1", and counts as one state.
 */
export function buildFseTable(probabilities: readonly number[], accuracyLog: number): FseTable {
  const size = 1 << accuracyLog;
  const symbols = new Uint8Array(size);
  let rareStart = size;
  probabilities.forEach((probability, symbol) => {
    if (probability === -1) symbols[--rareStart] = symbol;
  });
  const step = (size >> 1) + (size >> 3) + 3;
  let position = 0;
  probabilities.forEach((probability, symbol) => {
    for (let i = 0; i < probability; i++) {
      symbols[position] = symbol;
      do position = (position + step) & (size - 1);
      while (position >= rareStart);
    }
  });
  const bits = new Uint8Array(size);
  const baselines = new Uint16Array(size);
  const nextOf = probabilities.map((probability) => Math.abs(probability));
  for (let state = 0; state < size; state++) {
    const next = nextOf[symbols[state]]++;
    bits[state] = accuracyLog - highestBit(next);
    baselines[state] = (next << bits[state]) - size;
  }
  return { accuracyLog, symbols, bits, baselines };
}

/**
 * Reads the description of a table at byte `start` of a block that ends before byte `end`.
 * @returns The table; `next` is the byte offset after the description.
 */
export function readFseTable(
  bytes: Uint8Array,
  start: number,
  end: number,
  limits: { readonly maxAccuracyLog: number; readonly maxSymbol: number },
): { table: FseTable; next: number } {
  const accuracyLog = (bytes[start] & 15) + 5;
  if (start >= end || accuracyLog > limits.maxAccuracyLog) throw new ZstdError('a table of too many states', start);
  const probabilities: number[] = [];
  let bit = 4;
  const peek = (count: number): number => {
    const at = start + (bit >>> 3);
    const word = (bytes[at] ?? 0) | ((bytes[at + 1] ?? 0) << 8) | ((bytes[at + 2] ?? 0) << 16);
    return (word >>> (bit & 7)) & ((1 << count) - 1);
  };
  let remaining = 1 << accuracyLog;
  while (remaining > 0 && probabilities.length <= limits.maxSymbol) {
    // Values that exceed the remaining probability do not occur, so that some codes are one bit shorter.
    const count = highestBit(remaining + 1) + 1;
    const short = peek(count - 1);
    const shortValues = (1 << count) - 2 - remaining;
    const isShort = short < shortValues;
    const long = peek(count);
    const value = isShort ? short : long >= 1 << (count - 1) ? long - shortValues : long;
    bit += isShort ? count - 1 : count;
    const probability = value - 1;
    probabilities.push(probability);
    remaining -= Math.abs(probability);
    if (probability !== 0) continue;
    let zeros: number;
    do {
      zeros = peek(2);
      bit += 2;
      for (let i = 0; i < zeros; i++) probabilities.push(0);
    } while (zeros === 3 && probabilities.length <= limits.maxSymbol);
  }
  const next = start + Math.ceil(bit / 8);
  if (remaining !== 0 || probabilities.length > limits.maxSymbol + 1 || next > end) {
    throw new ZstdError('a table whose probabilities do not add up', start);
  }
  return { table: buildFseTable(probabilities, accuracyLog), next };
}
