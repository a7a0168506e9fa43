/** Small helpers on byte arrays that several readers share. */
import { GaussianSplatError } from '@gaussian-splat/core';

const latin1 = new TextDecoder('latin1');

/** Bytes `start` to `end` (negative: counted from the end) as text, one character for each byte; only ASCII characters are meaningful. */
export function asciiOf(bytes: Uint8Array, start = 0, end = bytes.length): string {
  return latin1.decode(bytes.subarray(start, end));
}

/** True if the file begins with these bytes, or with these ASCII characters. */
export function startsWith(bytes: Uint8Array, signature: readonly number[] | string, at = 0): boolean {
  const expected = typeof signature === 'string' ? Array.from(signature, (c) => c.charCodeAt(0)) : signature;
  return bytes.length >= at + expected.length && expected.every((byte, i) => bytes[at + i] === byte);
}

/** True if the file begins as an object in JSON does; a byte-order mark and space may come before. */
export function isJsonObject(bytes: Uint8Array): boolean {
  return /^(\u00ef\u00bb\u00bf)?\s*\{/.test(asciiOf(bytes, 0, 64));
}

/** A view of the same bytes for reading numbers of any type and byte order. */
export function viewOf(bytes: Uint8Array): DataView {
  return new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
}

/** A file as its bytes: what `Response.arrayBuffer()` gives, or any view of memory. */
export type FileBytes = ArrayBuffer | ArrayBufferView<ArrayBufferLike>;

/** The same memory as plain bytes. Node's Buffers, too: some of their methods share memory where those of a Uint8Array copy it. */
export function plainBytes(file: FileBytes, name: string): Uint8Array {
  if (ArrayBuffer.isView(file)) return new Uint8Array(file.buffer, file.byteOffset, file.byteLength);
  // By its tag, because that of another window or realm is no instance of this one's class.
  if (Object.prototype.toString.call(file) === '[object ArrayBuffer]') return new Uint8Array(file);
  throw new GaussianSplatError('argument/value', {
    where: name,
    expected: 'the bytes of a scene file: a Uint8Array or an ArrayBuffer',
    found: kindOf(file),
    remedy: 'pass the bytes of the file, or call fetchScene(url)',
  });
}

/** What a value is, for error messages. */
function kindOf(value: unknown): string {
  if (value === null || typeof value !== 'object') return value === null ? 'null' : typeof value;
  return value.constructor?.name || 'an object';
}

/** The bytes at an address that is a multiple of 4, as typed-array views need: the same memory, or a copy. */
export function alignedTo4(bytes: Uint8Array): Uint8Array {
  return bytes.byteOffset % 4 === 0 ? bytes : new Uint8Array(bytes);
}

/** True where typed arrays read little-endian files directly: on every platform with a browser today. */
export const hostIsLittleEndian = new Uint8Array(new Uint16Array([1]).buffer)[0] === 1;

/** Text in quotes, cut to `limit` characters, with unprintable characters escaped, for error messages. */
export function quote(text: string, limit = 60): string {
  return JSON.stringify(text.length > limit ? `${text.slice(0, limit)}...` : text);
}

/** Digits grouped for people: 1,234,567. */
export function grouped(value: number): string {
  return String(value).replace(/\B(?=(\d{3})+$)/g, ',');
}

/** Bytes of a buffer that are reserved at once; longer files grow into place. */
const MAX_RESERVED = 2 ** 28;
/** How many times as many bytes as have come are reserved next, where so many are expected. */
const MAX_GROWTH = 8;

/** A byte buffer that grows as chunks arrive. */
export class GrowingBytes {
  readonly #expected: number;
  #bytes: Uint8Array<ArrayBuffer>;
  #length = 0;

  /** @param expected bytes that will come; a guess that may be wrong either way. */
  constructor(expected: number) {
    this.#expected = expected;
    this.#bytes = new Uint8Array(Math.min(expected, MAX_RESERVED));
  }

  get length(): number {
    return this.#length;
  }

  append(chunk: Uint8Array): void {
    const needed = this.#length + chunk.length;
    if (needed > this.#bytes.length) {
      const growth = needed > this.#expected ? 2 * needed : Math.min(this.#expected, MAX_GROWTH * needed);
      const larger = new Uint8Array(growth);
      larger.set(this.#bytes.subarray(0, this.#length));
      this.#bytes = larger;
    }
    this.#bytes.set(chunk, this.#length);
    this.#length = needed;
  }

  /** What has arrived so far, without copying. */
  view(): Uint8Array<ArrayBuffer> {
    return this.#bytes.subarray(0, this.#length);
  }
}
