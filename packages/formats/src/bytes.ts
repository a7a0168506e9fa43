/** Helpers for byte arrays, shared by several readers. */
import { GaussianSplatError } from '@gaussian-splat/core';

const latin1 = new TextDecoder('latin1');

/** Bytes `start` to `end` (negative: counted from the end) as text, one character for each byte; only ASCII characters are meaningful. */
export function asciiOf(bytes: Uint8Array, start = 0, end = bytes.length): string {
  return latin1.decode(bytes.subarray(start, end));
}

/** Whether the file begins with these bytes, or with these ASCII characters. */
export function startsWith(bytes: Uint8Array, signature: readonly number[] | string, at = 0): boolean {
  const expected = typeof signature === 'string' ? Array.from(signature, (c) => c.charCodeAt(0)) : signature;
  return bytes.length >= at + expected.length && expected.every((byte, i) => bytes[at + i] === byte);
}

/** Whether the file begins like a JSON object, after an optional byte-order mark and whitespace. */
export function isJsonObject(bytes: Uint8Array): boolean {
  return /^(\u00ef\u00bb\u00bf)?\s*\{/.test(asciiOf(bytes, 0, 64));
}

/** Returns a DataView of the same bytes. */
export function viewOf(bytes: Uint8Array): DataView {
  return new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
}

/** A file as its bytes: what `Response.arrayBuffer()` gives, or any view of memory. */
export type FileBytes = ArrayBuffer | ArrayBufferView<ArrayBufferLike>;

/**
 * Returns the same memory as a plain Uint8Array, also for Node's Buffers, because some of their methods share memory
 * that those of a Uint8Array copy.
 */
export function plainBytes(file: FileBytes, name: string): Uint8Array {
  if (ArrayBuffer.isView(file)) return new Uint8Array(file.buffer, file.byteOffset, file.byteLength);
  // Tested by its tag, because an ArrayBuffer of another realm is not an instance of this class.
  if (Object.prototype.toString.call(file) === '[object ArrayBuffer]') return new Uint8Array(file);
  throw new GaussianSplatError('argument/value', {
    where: name,
    expected: 'the bytes of a scene file: a Uint8Array or an ArrayBuffer',
    found: kindOf(file),
    remedy: 'pass the bytes of the file, or call fetchScene(url)',
  });
}

/** Describes the type of a value, for error messages. */
function kindOf(value: unknown): string {
  if (value === null || typeof value !== 'object') return value === null ? 'null' : typeof value;
  return value.constructor?.name || 'an object';
}

/** Returns the bytes at an address that is a multiple of 4, as typed-array views require: the same memory, or a copy. */
export function alignedTo4(bytes: Uint8Array): Uint8Array {
  return bytes.byteOffset % 4 === 0 ? bytes : new Uint8Array(bytes);
}

/** Whether typed arrays can read little-endian files directly: true on every platform with a browser today. */
export const hostIsLittleEndian = new Uint8Array(new Uint16Array([1]).buffer)[0] === 1;

/** Text in quotes, cut to `limit` characters, with unprintable characters escaped, for error messages. */
export function quote(text: string, limit = 60): string {
  return JSON.stringify(text.length > limit ? `${text.slice(0, limit)}...` : text);
}

/** Formats a number with grouped digits: 1,234,567. */
export function grouped(value: number): string {
  return String(value).replace(/\B(?=(\d{3})+$)/g, ',');
}

/** Maximum number of bytes to reserve at once; longer files grow. */
const MAX_RESERVED = 2 ** 28;
/** Maximum growth factor of the reservation over the received bytes, towards the expected size. */
const MAX_GROWTH = 8;

/** A byte buffer that grows as chunks arrive. */
export class GrowingBytes {
  readonly #expected: number;
  #bytes: Uint8Array<ArrayBuffer>;
  #length = 0;

  /** @param expected Expected number of bytes; may be wrong either way. */
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

  /** Returns the received bytes, without copying. */
  view(): Uint8Array<ArrayBuffer> {
    return this.#bytes.subarray(0, this.#length);
  }
}
