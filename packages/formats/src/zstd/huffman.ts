import { BackwardBits, highestBit, ZstdError } from './bits.js';
import { readFseTable } from './fse.js';

/** Decoding table of a prefix code (RFC 8878, 4.2). The next `maxBits` bits are the index of a symbol and its length. */
export interface HuffmanTable {
  readonly maxBits: number;
  readonly symbols: Uint8Array;
  readonly lengths: Uint8Array;
}

const MAX_BITS = 11;
const MAX_WEIGHTS = 255;

/** Reads the description of a prefix code at byte `start`. In the result, `next` is the byte offset after it. */
export function readHuffmanTable(bytes: Uint8Array, start: number, end: number): { table: HuffmanTable; next: number } {
  const header = start < end ? bytes[start] : 0;
  const count = header - 127;
  const next = start + 1 + (header < 128 ? header : (count + 1) >> 1);
  if (next > end || header === 0) throw new ZstdError('a prefix code that overruns its block', start);
  const weights =
    header < 128
      ? readCodedWeights(bytes, start + 1, next)
      : Array.from({ length: count }, (_, i) => (bytes[start + 1 + (i >> 1)] >> (i % 2 === 0 ? 4 : 0)) & 15);
  return { table: buildHuffmanTable(weights, start), next };
}

/** Reads weights in a finite-state code up to the end of its bits, with two alternating states. */
function readCodedWeights(bytes: Uint8Array, start: number, end: number): number[] {
  const { table, next } = readFseTable(bytes, start, end, { maxAccuracyLog: 6, maxSymbol: 255 });
  const bits = new BackwardBits(bytes, next, end);
  const states = [bits.read(table.accuracyLog), bits.read(table.accuracyLog)];
  const weights: number[] = [];
  for (let turn = 0; weights.length < MAX_WEIGHTS; turn ^= 1) {
    const state = states[turn];
    weights.push(table.symbols[state]);
    states[turn] = table.baselines[state] + bits.read(table.bits[state]);
    if (bits.left < 0) {
      weights.push(table.symbols[states[turn ^ 1]]);
      return weights;
    }
  }
  throw new ZstdError('a prefix code of too many symbols', start);
}

/**
 * Builds the table of a prefix code from weights. A symbol of weight w > 0 has a code of maxBits + 1 - w bits. The weight
 * of the last symbol is not in `weights`, because it follows from the others.
 */
function buildHuffmanTable(weights: readonly number[], at: number): HuffmanTable {
  const share = (weight: number): number => (weight > 0 ? 1 << (weight - 1) : 0);
  const sum = weights.reduce((total, weight) => total + share(weight), 0);
  const maxBits = sum > 0 ? highestBit(sum) + 1 : MAX_BITS + 1;
  const rest = (1 << maxBits) - sum;
  if (maxBits > MAX_BITS || (rest & (rest - 1)) !== 0 || weights.length > MAX_WEIGHTS) {
    throw new ZstdError('a prefix code whose lengths do not add up', at);
  }
  const all = [...weights, highestBit(rest) + 1];
  const symbols = new Uint8Array(1 << maxBits);
  const lengths = new Uint8Array(1 << maxBits);
  let entry = 0;
  for (let weight = 1; weight <= maxBits; weight++) {
    all.forEach((symbolWeight, symbol) => {
      if (symbolWeight !== weight) return;
      symbols.fill(symbol, entry, entry + share(weight));
      lengths.fill(maxBits + 1 - weight, entry, entry + share(weight));
      entry += share(weight);
    });
  }
  return { maxBits, symbols, lengths };
}

/** Decodes the stream of the bytes `start` to `end` into all of `out`. Throws {@link ZstdError}. */
export function decodeHuffmanStream(
  table: HuffmanTable,
  bytes: Uint8Array,
  start: number,
  end: number,
  out: Uint8Array,
): void {
  const { maxBits, symbols, lengths } = table;
  const bits = new BackwardBits(bytes, start, end);
  for (let i = 0; i < out.length; i++) {
    const code = bits.peek(maxBits);
    out[i] = symbols[code];
    bits.left -= lengths[code];
  }
  if (bits.left !== 0) throw new ZstdError('literals of another length than announced', start);
}
