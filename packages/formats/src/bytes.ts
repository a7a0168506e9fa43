/** Helpers for byte arrays, shared by several readers. */
import { GaussianSplatError } from '@gaussian-splat/core';

const latin1 = new TextDecoder('latin1');

/**
 * Decodes bytes `start` to `end`, excluding `end`, as one character each. Negative offsets count from the end of the
 * bytes. Only ASCII characters are reliable.
 */
export function asciiOf(bytes: Uint8Array, start = 0, end = bytes.length): string {
  return latin1.decode(bytes.subarray(start, end));
}

/** Whether `bytes` contains a signature at offset `at`. Each character of a string stands for the byte of its code. */
export function startsWith(bytes: Uint8Array, signature: readonly number[] | string, at = 0): boolean {
  const expected = typeof signature === 'string' ? Array.from(signature, (c) => c.charCodeAt(0)) : signature;
  return bytes.length >= at + expected.length && expected.every((byte, i) => bytes[at + i] === byte);
}

/** Whether the first character is `{`, after an optional byte-order mark and whitespace. Examines the first 64 bytes. */
export function isJsonObject(bytes: Uint8Array): boolean {
  return /^(\u00ef\u00bb\u00bf)?\s*\{/.test(asciiOf(bytes, 0, 64));
}

/** Returns a DataView of the same range of memory. */
export function viewOf(bytes: Uint8Array): DataView {
  return new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
}

/** Bytes of a file: an ArrayBuffer, as `Response.arrayBuffer()` returns, or any view of one. */
export type FileBytes = ArrayBuffer | ArrayBufferView<ArrayBufferLike>;

/**
 * Returns a Uint8Array of the same memory as a file. A Buffer of Node is converted, too, because its `slice` does not
 * copy, unlike that of a Uint8Array.
 * @param name Name of the file in error messages.
 * @throws GaussianSplatError `argument/value` if `file` is neither an ArrayBuffer nor a view.
 */
export function plainBytes(file: FileBytes, name: string): Uint8Array {
  if (ArrayBuffer.isView(file)) return new Uint8Array(file.buffer, file.byteOffset, file.byteLength);
  // `instanceof` fails for an ArrayBuffer of another realm, for example of an iframe.
  if (Object.prototype.toString.call(file) === '[object ArrayBuffer]') return new Uint8Array(file);
  throw new GaussianSplatError('argument/value', {
    where: name,
    expected: 'the bytes of a scene file: a Uint8Array or an ArrayBuffer',
    found: kindOf(file),
    remedy: 'pass the bytes of the file, or call fetchScene(url)',
  });
}

/** Returns the type of a value for error messages: `null`, the result of `typeof`, or the name of its class. */
function kindOf(value: unknown): string {
  if (value === null || typeof value !== 'object') return value === null ? 'null' : typeof value;
  return value.constructor?.name || 'an object';
}

/** Returns `bytes` if their offset is a multiple of 4, as views of 32-bit numbers require; otherwise a copy. */
export function alignedTo4(bytes: Uint8Array): Uint8Array {
  return bytes.byteOffset % 4 === 0 ? bytes : new Uint8Array(bytes);
}

/** Whether typed arrays use the byte order of little-endian files. All platforms with current browsers do. */
export const hostIsLittleEndian = new Uint8Array(new Uint16Array([1]).buffer)[0] === 1;

/** Quotes text for error messages: at most `limit` characters of it, with unprintable characters escaped. */
export function quote(text: string, limit = 60): string {
  return JSON.stringify(text.length > limit ? `${text.slice(0, limit)}...` : text);
}

export { grouped } from '@gaussian-splat/core/fetch';

/** Maximum number of bytes that the constructor of {@link GrowingBytes} reserves. */
const MAX_RESERVED = 2 ** 28;
/** Maximum ratio of the reserved to the received bytes, up to the expected size. */
const MAX_GROWTH = 8;

/** Size of the buffer of a {@link GrowingBytes} that keeps only its last bytes. */
const FORGETFUL_BYTES = 1 << 21;

/** A byte buffer that grows as chunks arrive. */
export class GrowingBytes {
  readonly #expected: number;
  #bytes: Uint8Array<ArrayBuffer>;
  #length = 0;
  /** Number of bytes at the beginning that were discarded: see {@link forget}. */
  #first = 0;

  /** @param expected Expected number of bytes. The actual number may be smaller or larger. */
  constructor(expected: number) {
    this.#expected = expected;
    this.#bytes = new Uint8Array(Math.min(expected, MAX_RESERVED));
  }

  /** Number of received bytes, including those that were discarded. */
  get length(): number {
    return this.#first + this.#length;
  }

  /** Offset of the first byte of {@link view}. */
  get first(): number {
    return this.#first;
  }

  /** Discards all bytes but the last `kept`. */
  forget(kept: number): void {
    const from = Math.max(0, this.#length - kept);
    if (from === 0) return;
    const rest = this.#bytes.subarray(from, this.#length);
    if (this.#bytes.length <= FORGETFUL_BYTES) this.#bytes.copyWithin(0, from, this.#length);
    else (this.#bytes = new Uint8Array(FORGETFUL_BYTES)).set(rest);
    this.#length -= from;
    this.#first += from;
  }

  append(chunk: Uint8Array): void {
    const needed = this.#length + chunk.length;
    if (needed > this.#bytes.length && this.#first > 0) {
      const larger = new Uint8Array(2 * needed);
      larger.set(this.#bytes.subarray(0, this.#length));
      this.#bytes = larger;
    } else if (needed > this.#bytes.length) {
      const growth = needed > this.#expected ? 2 * needed : Math.min(this.#expected, MAX_GROWTH * needed);
      const larger = new Uint8Array(growth);
      larger.set(this.#bytes.subarray(0, this.#length));
      this.#bytes = larger;
    }
    this.#bytes.set(chunk, this.#length);
    this.#length = needed;
  }

  /** Returns the received bytes. The array shares memory with the buffer until `append` enlarges the buffer. */
  view(): Uint8Array<ArrayBuffer> {
    return this.#bytes.subarray(0, this.#length);
  }
}
