import { GaussianSplatError } from '@gaussian-splat/core';
import { GrowingBytes, grouped } from '../bytes.js';
import type { SceneSource } from '../scene-format.js';

/** Compressed bytes handed over at once: what they can inflate to, at most 17 MB, may arrive before anyone can stop. */
const FEED_BYTES = 16_384;

/**
 * True of the error for bytes behind the end of the stream, which other readers of SPZ leave alone: padding, for one. All that is in the stream has come by then. Browsers tell
 * it in words only, each in its own.
 */
const isBehind = (cause: unknown): boolean => /junk|extra bytes|after the end/i.test(String((cause as Error).message));

/** Inflates a gzip file step by step, so that a header can be checked before its body is inflated. */
export class Gunzip {
  readonly #source: SceneSource;
  readonly #reader: ReadableStreamDefaultReader<Uint8Array>;
  readonly #output = new GrowingBytes(65_536);
  #isEnded = false;

  constructor(source: SceneSource) {
    this.#source = source;
    const { readable, writable } = new DecompressionStream('gzip');
    this.#reader = readable.getReader();
    // Errors of the stream reach us through the reader.
    this.#feed(writable.getWriter()).catch(() => {});
  }

  /** Inflates on until there are `length` bytes or the stream ends; returns all bytes so far, maybe more than asked. Throws `out-of-memory/budget` where the load may not take as many. */
  async upTo(length: number): Promise<Uint8Array> {
    const { budget, name } = this.#source;
    // What grows is there twice while it is copied.
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
    // Browsers name the two cases in words only.
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
