/** Compression of binary layers: LZ4 in a frame of their own, and integers as differences. */
import type { LoadBudget } from '../budget.js';
import { grouped, viewOf } from '../bytes.js';
import { fail } from './layer.js';

/** Maximum size of a chunk of LZ4. */
const MAX_CHUNK = 0x7e000000;

/** Compressed bytes, their place for messages, and the account of their load. */
export interface PackedBytes {
  readonly bytes: Uint8Array;
  readonly where: string;
  readonly budget: LoadBudget;
}

/**
 * Unpacks at most `size` bytes: a count of chunks, 0 for one without a length before it, and chunks of LZ4.
 * @throws GaussianSplatError `decode/corrupt`, `out-of-memory/budget`
 */
export function unpack({ bytes, where, budget }: PackedBytes, size: number): Uint8Array {
  budget.take(size, where);
  const out = new Uint8Array(size);
  const chunks = bytes[0];
  if (chunks === 0) return out.subarray(0, unpackChunk(bytes.subarray(1), out, where));
  const view = viewOf(bytes);
  let length = 0;
  for (let k = 0, at = 1; k < chunks; k++) {
    const packed = at + 4 <= bytes.length ? view.getInt32(at, true) : -1;
    if (packed < 0 || at + 4 + packed > bytes.length) fail(where, 'a chunk of LZ4', 'the end of the section');
    const chunk = bytes.subarray(at + 4, at + 4 + packed);
    length += unpackChunk(chunk, out.subarray(length, length + MAX_CHUNK), where);
    at += 4 + packed;
  }
  return out.subarray(0, length);
}

/** Unpacks a block of LZ4, and returns the number of bytes. */
function unpackChunk(bytes: Uint8Array, out: Uint8Array, where: string): number {
  let [at, length] = [0, 0];
  const damage = (): never => fail(where, 'an intact block of LZ4', `damage at byte ${grouped(at)}`);
  const readLength = (nibble: number): number => {
    let sum = nibble;
    for (let byte = nibble === 15 ? 255 : 0; byte === 255; sum += byte)
      byte = at < bytes.length ? bytes[at++] : damage();
    return sum;
  };
  while (at < bytes.length) {
    const token = bytes[at++];
    const literals = readLength(token >> 4);
    if (at + literals > bytes.length || length + literals > out.length) damage();
    out.set(bytes.subarray(at, at + literals), length);
    at += literals;
    length += literals;
    // The last sequence has literals alone.
    if (at >= bytes.length) break;
    const back = bytes[at] | (bytes[at + 1] << 8);
    at += 2;
    const copied = 4 + readLength(token & 15);
    if (at > bytes.length || back === 0 || back > length || length + copied > out.length) damage();
    for (const end = length + copied; length < end; length++) out[length] = out[length - back];
  }
  return length;
}

/**
 * Unpacks 32-bit integers: the most common difference, a code of 2 bits for each difference, and the differences that
 * are not the most common one, in 1, 2 or 4 bytes.
 * @throws GaussianSplatError `decode/corrupt`, `out-of-memory/budget`
 */
export function unpackIntegers(packed: PackedBytes, count: number): Int32Array {
  const { where, budget } = packed;
  if (count === 0) return new Int32Array(0);
  const codesEnd = 4 + Math.ceil(count / 4);
  const raw = unpack(packed, codesEnd + 4 * count);
  budget.take(4 * count, where);
  const view = viewOf(raw);
  const short = (): never => fail(where, `${grouped(count)} integers`, 'fewer');
  if (codesEnd > raw.length) short();
  const common = view.getInt32(0, true);
  const integers = new Int32Array(count);
  for (let i = 0, at = codesEnd, sum = 0; i < count; i++) {
    const code = (raw[4 + (i >> 2)] >> (2 * (i & 3))) & 3;
    const size = code === 3 ? 4 : code;
    if (at + size > raw.length) short();
    const difference =
      size === 0
        ? common
        : size === 1
          ? view.getInt8(at)
          : size === 2
            ? view.getInt16(at, true)
            : view.getInt32(at, true);
    at += size;
    sum = (sum + difference) | 0;
    integers[i] = sum;
  }
  return integers;
}
