import { GaussianSplatError } from '@gaussian-splat/core';
import { GrowingBytes, grouped } from '../bytes.js';
import type { SceneSource } from '../scene-format.js';

/** Compressed bytes fed in one step: they may inflate to 17 MB before the stream can be stopped. */
const FEED_BYTES = 16_384;

/**
 * Whether the error is about bytes after the end of the stream, such as padding, which other readers of SPZ ignore. The
 * complete stream has been received then. Browsers report it only in the message, each differently.
 */
const isBehind = (cause: unknown): boolean => /junk|extra bytes|after the end/i.test(String((cause as Error).message));

/** Inflates a gzip file in steps, so that a header can be checked before its body is inflated. */
export class Gunzip {
  readonly #source: SceneSource;
  readonly #reader: ReadableStreamDefaultReader<Uint8Array>;
  readonly #output = new GrowingBytes(65_536);
  #isEnded = false;

  constructor(source: SceneSource) {
    this.#source = source;
    const { readable, writable } = new DecompressionStream('gzip');
    this.#reader = readable.getReader();
    // Errors of the stream are reported by the reader.
    this.#feed(writable.getWriter()).catch(() => {});
  }

  /**
   * Inflates until there are `length` bytes or the stream ends; returns all inflated bytes, possibly more. Throws
   * `out-of-memory/budget` if the load may not allocate as many.
   */
  async upTo(length: number): Promise<Uint8Array> {
    const { budget, name } = this.#source;
    // A growing buffer exists twice while it is copied.
    budget.take(2 * length, name);
    while (this.#output.length < length && !this.#isEnded) {
      this.#source.signal?.throwIfAborted();
      const { value } = await this.#reader.read().catch((cause: unknown) => {
        if (!isBehind(cause)) return this.#fail(cause);
        return { value: undefined };
      });
      if (value) this.#output.append(value);
      else this.#isEnded = true;
    }
    return this.#output.view();
  }

  /** Stops inflating. */
  close(): void {
    this.#reader.cancel().catch(() => {});
  }

  async #feed(writer: WritableStreamDefaultWriter<BufferSource>): Promise<void> {
    const { bytes } = this.#source;
    for (let at = 0; at < bytes.length; at += FEED_BYTES) {
      await writer.write(bytes.slice(at, at + FEED_BYTES));
    }
    await writer.close();
  }

  #fail(cause: unknown): never {
    const { name, bytes } = this.#source;
    // Browsers distinguish the two cases only in the message.
    const isCut = /unexpected end|truncated|incomplete|ended/i.test(String((cause as Error).message));
    throw new GaussianSplatError(isCut ? 'decode/truncated' : 'decode/corrupt', {
      where: `${name}, ${isCut ? `byte ${grouped(bytes.length)} (end of the file)` : 'gzip stream'}`,
      expected: 'an intact gzip stream',
      found: isCut
        ? `one that is cut after ${grouped(this.#output.length)} inflated bytes`
        : `a damaged one after ${grouped(this.#output.length)} inflated bytes`,
      remedy: 'download or export the file again; it did not arrive whole',
      cause,
    });
  }
}
