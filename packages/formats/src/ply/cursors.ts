import { GaussianSplatError } from '@gaussian-splat/core';
import { grouped, quote, viewOf } from '../bytes.js';
import type { SceneSource } from '../scene-format.js';
import { sizeOf, type ScalarType } from './header.js';

/** Reads the values of a PLY body in sequence, for rows without a fixed size. */
export interface ValueCursor {
  /** Byte offset in the file of the next value. */
  readonly position: number;
  /** Whether the last request exceeded the end of the file. */
  readonly ended: boolean;
  /** Reads the next value; returns NaN at the end of the file. */
  next(type: ScalarType): number;
  /** Skips `count` values of one type. */
  skip(type: ScalarType, count: number): void;
}

/** Returns a function that reads one value of a type from a view, at a byte offset. */
export function scalarGetter(type: ScalarType, littleEndian: boolean): (view: DataView, at: number) => number {
  switch (type) {
    case 'int8':
      return (view, at) => view.getInt8(at);
    case 'uint8':
      return (view, at) => view.getUint8(at);
    case 'int16':
      return (view, at) => view.getInt16(at, littleEndian);
    case 'uint16':
      return (view, at) => view.getUint16(at, littleEndian);
    case 'int32':
      return (view, at) => view.getInt32(at, littleEndian);
    case 'uint32':
      return (view, at) => view.getUint32(at, littleEndian);
    // Integers beyond 2⁵³ are rounded to float64.
    case 'int64':
      return (view, at) => Number(view.getBigInt64(at, littleEndian));
    case 'uint64':
      return (view, at) => Number(view.getBigUint64(at, littleEndian));
    case 'float32':
      return (view, at) => view.getFloat32(at, littleEndian);
    case 'float64':
      return (view, at) => view.getFloat64(at, littleEndian);
  }
}

export class BinaryCursor implements ValueCursor {
  readonly #view: DataView;
  readonly #littleEndian: boolean;
  position: number;
  ended = false;

  constructor(source: SceneSource, position: number, littleEndian: boolean) {
    this.#view = viewOf(source.bytes);
    this.#littleEndian = littleEndian;
    this.position = position;
  }

  next(type: ScalarType): number {
    const at = this.position;
    this.skip(type, 1);
    return this.ended ? NaN : scalarGetter(type, this.#littleEndian)(this.#view, at);
  }

  skip(type: ScalarType, count: number): void {
    const end = this.position + count * sizeOf(type);
    this.ended = end > this.#view.byteLength;
    if (!this.ended) this.position = end;
  }
}

const SPACE = 32;
/** Matches the spellings of NaN that C libraries write. Splats with such values are dropped later. */
const NOT_A_NUMBER = /^[+-]?(nan(\(.*\))?|1\.#(ind|qnan|snan)0*)$/i;
const INFINITE = /^[+-]?(inf(inity)?|1\.#inf0*)$/i;
const NUMBER = /^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?$/i;
/** Maximum length of a number in characters. A float64 needs 25. */
const MAX_TOKEN = 256;

export class AsciiCursor implements ValueCursor {
  readonly #source: SceneSource;
  position: number;
  ended = false;

  constructor(source: SceneSource, position: number) {
    this.#source = source;
    this.position = position;
  }

  next(): number {
    const token = this.#token();
    // `Number` also accepts other spellings, such as 0x10, which PLY does not have.
    const value = Number(token);
    if (token === '' || (value === value && NUMBER.test(token))) return token === '' ? NaN : value;
    if (NOT_A_NUMBER.test(token)) return NaN;
    if (INFINITE.test(token)) return token.startsWith('-') ? -Infinity : Infinity;
    return this.#fail(token);
  }

  skip(_type: ScalarType, count: number): void {
    for (let i = 0; i < count && !this.ended; i++) this.#token();
  }

  /**
   * Skips white space, and returns the characters up to the next white space; an empty string at the end of the file.
   * Throws for more than {@link MAX_TOKEN} characters.
   */
  #token(): string {
    const { bytes, isPrefix } = this.#source;
    let start = this.position;
    while (start < bytes.length && bytes[start] <= SPACE) start++;
    let end = start;
    let token = '';
    while (end < bytes.length && bytes[end] > SPACE && end - start <= MAX_TOKEN) {
      token += String.fromCharCode(bytes[end++]);
    }
    this.position = end;
    // The last token of a file that is still loading may be incomplete.
    this.ended = token === '' || (isPrefix === true && end === bytes.length);
    return token.length > MAX_TOKEN ? this.#fail(token) : token;
  }

  #fail(token: string): never {
    const isCut = this.position === this.#source.bytes.length;
    throw new GaussianSplatError(isCut ? 'decode/truncated' : 'decode/corrupt', {
      where: `${this.#source.name}, byte ${grouped(this.position - token.length)}`,
      expected: 'a number',
      found: quote(token, 24),
      remedy: `export the file again; its text is ${isCut ? 'incomplete' : 'damaged'}`,
    });
  }
}
