import { halfToNumber } from '@gaussian-splat/core';
import { grouped, hostIsLittleEndian } from '../bytes.js';
import type { CrateBytes } from './crate-bytes.js';
import { ATTRIBUTE_BYTES, type LateValue, type UsdAttribute, type UsdValue } from './layer.js';

/** Types of scalars in a binary layer. `bytes` in the file. */
interface Scalar {
  readonly bytes: 2 | 4 | 8;
  readonly get: (view: DataView, at: number) => number;
}

const INT: Scalar = { bytes: 4, get: (view, at) => view.getInt32(at, true) };
const UINT: Scalar = { bytes: 4, get: (view, at) => view.getUint32(at, true) };
const HALF: Scalar = { bytes: 2, get: (view, at) => halfToNumber(view.getUint16(at, true)) };
const FLOAT: Scalar = { bytes: 4, get: (view, at) => view.getFloat32(at, true) };
const DOUBLE: Scalar = { bytes: 8, get: (view, at) => view.getFloat64(at, true) };

/** Types of numbers: their scalar, and the count of scalars in an element. */
const NUMBERS: ReadonlyMap<number, readonly [Scalar, number]> = new Map([
  [3, [INT, 1]],
  [4, [UINT, 1]],
  [7, [HALF, 1]],
  [8, [FLOAT, 1]],
  [9, [DOUBLE, 1]],
  [15, [DOUBLE, 16]],
  ...[DOUBLE, FLOAT, HALF].map((scalar, k) => [16 + k, [scalar, 4]] as const),
  ...[2, 3, 4].flatMap((width, k) =>
    [DOUBLE, FLOAT, HALF, INT].map((scalar, n) => [19 + 4 * k + n, [scalar, width]] as const),
  ),
  [48, [DOUBLE, 1]],
  [56, [DOUBLE, 1]],
]);
const [STRING, DICTIONARY] = [10, 31];
const [BOOL, TOKEN, MATRIX_4D, TOKEN_LIST, SPECIFIER, TIME_SAMPLES, DOUBLE_VECTOR] = [1, 11, 15, 32, 42, 46, 48];
const isQuaternion = (type: number): boolean => type >= 16 && type <= 18;
/** Arrays of fewer elements are not compressed, even if they are marked as such. */
const MIN_COMPRESSED = 16;
/** Bits of the first byte of a list: whether it has explicit items, and prepended, added or appended ones. */
const [HAS_EXPLICIT, HAS_ADDED, HAS_PREPENDED, HAS_APPENDED] = [2, 4, 32, 64];

/** A value of a field, as a binary layer stores it: type and flags, and either the value or the place of it. */
export interface ValueRep {
  readonly low: number;
  readonly high: number;
}

/** Reads values of fields of a binary layer. */
export class CrateValues {
  readonly #file: CrateBytes;
  readonly #tokens: readonly string[];
  /** Version, as 100 · minor + patch. */
  readonly #version: number;
  /** Place of the section of strings: their number, and the index of the token of each. */
  readonly #strings: number | undefined;

  constructor(file: CrateBytes, tokens: readonly string[], version: number, strings: number | undefined) {
    this.#file = file;
    this.#tokens = tokens;
    this.#version = version;
    this.#strings = strings;
  }

  /** Returns a value; undefined for types that no splats need. Throws `decode/corrupt`, `decode/truncated`, `out-of-memory/budget`. */
  read({ low, high }: ValueRep): UsdValue | undefined {
    const { type, isArray, isInline, isPacked, at } = fieldsOf({ low, high });
    if (type === BOOL && !isArray) return low !== 0;
    if (type === SPECIFIER) return ['def', 'over', 'class'][low];
    if (type === TOKEN) return isArray ? this.#tokensAt(at) : this.#token(low);
    if (type === TOKEN_LIST) return isInline ? [] : this.#listAt(at);
    const known = NUMBERS.get(type);
    if (!known) return undefined;
    const [scalar, width] = known;
    if (isInline && !isArray) return inlined(low, type, scalar, width);
    if (type === DOUBLE_VECTOR) return this.#plain(scalar, 1, this.#file.u64(at), at + 8);
    if (isArray) return at === 0 ? new Float32Array(0) : this.#array(type, scalar, width, at, isPacked);
    const numbers = this.#plain(scalar, width, 1, at);
    return width === 1 ? numbers[0] : wFirst(numbers, type);
  }

  /** Returns the texts of a dictionary by name. Its entries have a name, and the distance and the field of a value. */
  dictionary(rep: ValueRep): Map<string, string> {
    const { type, at } = fieldsOf(rep);
    const texts = new Map<string, string>();
    if (type !== DICTIONARY || this.#strings === undefined) return texts;
    const count = this.#file.u64(at);
    for (let k = 0, entry = at + 8; k < count; k++) {
      const valueAt = entry + 4 + this.#file.u64(entry + 4);
      const value = this.#repAt(valueAt);
      this.#file.take(ATTRIBUTE_BYTES);
      if (fieldsOf(value).type === STRING) texts.set(this.#string(this.#file.u32(entry)), this.#string(value.low));
      entry = valueAt + 8;
    }
    return texts;
  }

  #string(index: number): string {
    return this.#token(this.#file.u32(this.#strings! + 8 + 4 * index));
  }

  /** Returns the samples of an attribute: the times and values that a field of time samples names. */
  samples(rep: ValueRep): UsdAttribute['samples'] {
    const { type, at } = fieldsOf(rep);
    if (type !== TIME_SAMPLES) return undefined;
    const timesAt = at + this.#file.u64(at);
    const times = this.read(this.#repAt(timesAt));
    const valuesAt = timesAt + 8 + this.#file.u64(timesAt + 8);
    const count = this.#file.u64(valuesAt);
    if (!(times instanceof Float64Array) || times.length !== count)
      return this.#file.fault(at, 'a time for each sample', `${grouped(count)} samples`);
    this.#file.take(ATTRIBUTE_BYTES * count);
    return Array.from(times, (time, k) => {
      return { time, value: this.late(this.#repAt(valuesAt + 8 + 8 * k)) };
    }).sort((a, b) => a.time - b.time);
  }

  late(rep: ValueRep): LateValue {
    return () => this.read(rep);
  }

  /** Whether a field of arcs has any: an explicit list that is not empty, or items that are added. */
  hasItems({ low, high }: ValueRep): boolean {
    const { isInline, at, type } = fieldsOf({ low, high });
    const isList = (type >= 32 && type <= 39) || type === 54 || type === 55;
    if (isInline || !isList) return true;
    const flags = this.#file.slice(at, 1)[0];
    if (flags & (HAS_ADDED | HAS_PREPENDED | HAS_APPENDED)) return true;
    return (flags & HAS_EXPLICIT) !== 0 && this.#file.u64(at + 1) > 0;
  }

  #repAt(at: number): ValueRep {
    return { low: this.#file.u32(at), high: this.#file.u32(at + 4) };
  }

  #token(index: number): string {
    return (
      this.#tokens[index] ?? this.#file.fault(0, `${grouped(this.#tokens.length)} tokens`, `token ${grouped(index)}`)
    );
  }

  /** Returns the number of elements of an array, and the place of its first element. */
  #countAt(at: number): { count: number; start: number } {
    // Versions before 0.5 have a rank first, and those before 0.7 a count of 32 bits.
    const from = this.#version < 500 ? at + 4 : at;
    return this.#version < 700
      ? { count: this.#file.u32(from), start: from + 4 }
      : { count: this.#file.u64(from), start: from + 8 };
  }

  #tokensAt(at: number): string[] {
    if (at === 0) return [];
    const { count, start } = this.#countAt(at);
    return this.#tokenVector(start, count);
  }

  #tokenVector(start: number, count: number): string[] {
    this.#file.need(start, 4 * count);
    this.#file.take(16 * count);
    return Array.from({ length: count }, (_, k) => this.#token(this.#file.u32(start + 4 * k)));
  }

  /** Explicit, added, prepended and appended tokens of a list. */
  #listAt(start: number): string[] {
    const flags = this.#file.slice(start, 1)[0];
    const tokens: string[] = [];
    let at = start + 1;
    for (const flag of [HAS_EXPLICIT, HAS_ADDED, HAS_PREPENDED, HAS_APPENDED]) {
      if (!(flags & flag)) continue;
      const count = this.#file.u64(at);
      tokens.push(...this.#tokenVector(at + 8, count));
      at += 8 + 4 * count;
    }
    return tokens;
  }

  #array(type: number, scalar: Scalar, width: number, at: number, isPacked: boolean): Float32Array | Float64Array {
    const { count, start } = this.#countAt(at);
    const isUnpacked = !isPacked || this.#version < 500 || count < MIN_COMPRESSED || width > 1;
    const numbers = isUnpacked ? this.#plain(scalar, width, count, start) : this.#unpacked(scalar, count, start);
    return wFirst(numbers, type);
  }

  #allocate(scalar: Scalar, count: number): Float32Array | Float64Array {
    this.#file.take((scalar === DOUBLE ? 8 : 4) * count);
    return scalar === DOUBLE ? new Float64Array(count) : new Float32Array(count);
  }

  #plain(scalar: Scalar, width: number, elements: number, start: number): Float32Array | Float64Array {
    const count = width * elements;
    this.#file.need(start, scalar.bytes * count);
    const numbers = this.#allocate(scalar, count);
    const { bytes, view } = this.#file;
    if (scalar === FLOAT && hostIsLittleEndian) {
      new Uint8Array(numbers.buffer).set(bytes.subarray(start, start + 4 * count));
    } else {
      for (let k = 0; k < count; k++) numbers[k] = scalar.get(view, start + scalar.bytes * k);
    }
    return numbers;
  }

  /** Unpacks numbers: integers, or numbers of other types that are integers (`i`) or indices of a table (`t`). */
  #unpacked(scalar: Scalar, count: number, start: number): Float32Array | Float64Array {
    const file = this.#file;
    if (scalar === INT || scalar === UINT) {
      const { integers } = file.integers(start, count);
      const numbers = this.#allocate(scalar, count);
      for (let k = 0; k < count; k++) numbers[k] = scalar === UINT ? integers[k] >>> 0 : integers[k];
      return numbers;
    }
    const code = String.fromCharCode(file.slice(start, 1)[0]);
    if (code !== 'i' && code !== 't') return file.fault(start, 'numbers as integers or as a table', `the code ${code}`);
    const size = code === 't' ? file.u32(start + 1) : 0;
    const table = code === 't' ? this.#plain(scalar, 1, size, start + 5) : undefined;
    const { integers } = file.integers(table ? start + 5 + scalar.bytes * size : start + 1, count);
    const numbers = this.#allocate(scalar, count);
    for (let k = 0; k < count; k++) numbers[k] = table ? table[integers[k]] : integers[k];
    return numbers;
  }
}

function fieldsOf({ low, high }: ValueRep): {
  type: number;
  isArray: boolean;
  isInline: boolean;
  isPacked: boolean;
  at: number;
} {
  return {
    type: (high >>> 16) & 255,
    isArray: high >>> 31 === 1,
    isInline: ((high >>> 30) & 1) === 1,
    isPacked: ((high >>> 29) & 1) === 1,
    at: low + 2 ** 32 * (high & 0xffff),
  };
}

/** Decodes a value that is small enough for its field: one number, or bytes of small integers. */
function inlined(low: number, type: number, scalar: Scalar, width: number): number | Float64Array {
  const view = new DataView(new ArrayBuffer(4));
  view.setUint32(0, low, true);
  if (width === 1) return (scalar === DOUBLE ? FLOAT : scalar).get(view, 0);
  const numbers = new Float64Array(width);
  const isMatrix = type === MATRIX_4D;
  for (let k = 0; k < (isMatrix ? 4 : width); k++) numbers[isMatrix ? 5 * k : k] = view.getInt8(k);
  return numbers;
}

/** Converts quaternions (x, y, z, w), as binary layers have them, to (w, x, y, z) in place. */
function wFirst<T extends Float32Array | Float64Array>(numbers: T, type: number): T {
  if (!isQuaternion(type)) return numbers;
  for (let k = 0; k < numbers.length; k += 4) {
    const w = numbers[k + 3];
    numbers.copyWithin(k + 1, k, k + 3);
    numbers[k] = w;
  }
  return numbers;
}
