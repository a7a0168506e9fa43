import { GaussianSplatError } from '../errors.js';
import type { ByteSource } from './byte-source.js';

/**
 * Thrown by a read of bytes that are not in memory. The caller loads them with {@link LoadedBytes.load}, and repeats
 * the read.
 */
export class NotLoaded {
  readonly offset: number;

  constructor(offset: number) {
    this.offset = offset;
  }
}

interface Segment {
  readonly start: number;
  readonly end: number;
  readonly bytes: Uint8Array;
}

const utf8 = new TextDecoder();

/** Ranges of a file that are in memory. Synchronous reads of other ranges throw {@link NotLoaded}. */
export class LoadedBytes {
  readonly source: ByteSource;
  #segments: Segment[] = [];
  #current: Segment = { start: 0, end: 0, bytes: new Uint8Array(0) };
  #fieldsLeft: number;

  /** @param fieldLimit Maximum number of fields to read from the file, so that hostile files terminate. */
  constructor(source: ByteSource, fieldLimit: number) {
    this.source = source;
    this.#fieldsLeft = fieldLimit;
  }

  get size(): number {
    return this.source.size;
  }

  byteAt(offset: number): number {
    if (offset < this.#current.start || offset >= this.#current.end) this.#select(offset);
    return this.#current.bytes[offset - this.#current.start];
  }

  textAt(offset: number, length: number): string {
    if (length === 0) return '';
    const bytes = new Uint8Array(length);
    for (let done = 0; done < length;) {
      this.byteAt(offset + done);
      const { start, end, bytes: from } = this.#current;
      const count = Math.min(length - done, end - offset - done);
      bytes.set(from.subarray(offset + done - start, offset + done - start + count), done);
      done += count;
    }
    return utf8.decode(bytes);
  }

  /**
   * Loads a chunk of the source, from an offset on, into memory. Rejects with `decode/truncated` at the end of the
   * file.
   */
  async load(offset: number): Promise<void> {
    const length = Math.min(this.source.chunk, this.size - offset);
    const bytes = await this.source.read(offset, length);
    if (bytes.length === 0) throw this.fault('decode/truncated', offset, 'more bytes', 'the end of the file');
    this.#segments.push({ start: offset, end: offset + bytes.length, bytes });
  }

  /** Discards the ranges that end at or before an offset, which will not be read again. */
  forget(offset: number): void {
    if (this.#segments.length > 1) this.#segments = this.#segments.filter(({ end }) => end > offset);
  }

  countField(offset: number): void {
    if (--this.#fieldsLeft < 0) {
      throw this.fault(
        'decode/unsupported',
        offset,
        'fewer parts',
        'more parts than any model that this reader expects',
      );
    }
  }

  fault(
    code: 'decode/truncated' | 'decode/corrupt' | 'decode/unsupported',
    offset: number,
    expected: string,
    found: string,
  ): GaussianSplatError {
    return new GaussianSplatError(code, {
      where: `${this.source.name}, byte ${offset}`,
      expected,
      found,
      remedy:
        code === 'decode/unsupported'
          ? 'export a simpler model'
          : 'export or download the model again; the file is damaged or incomplete',
    });
  }

  #select(offset: number): void {
    const segment = this.#segments.findLast(({ start, end }) => offset >= start && offset < end);
    if (segment === undefined) throw new NotLoaded(offset);
    this.#current = segment;
  }
}
