import { GaussianSplatError, loadModule } from '@gaussian-splat/core';
import { GrowingBytes, grouped } from '../bytes.js';
import { decompressing } from '../decompression.js';
import type { SceneSource } from '../scene-format.js';

/**
 * Whether an error reports bytes after the end of the first member, such as padding or another member. Only the message
 * identifies the error, and it differs between browsers.
 */
const isBehind = (cause: unknown): boolean => /junk|extra bytes|after the end/i.test(String((cause as Error).message));

/** Inflates a gzip file in steps, so that a header can be checked before the rest is inflated. */
export class Gunzip {
  readonly #source: SceneSource;
  #reader: ReadableStreamDefaultReader<Uint8Array>;
  readonly #output = new GrowingBytes(65_536);
  #isEnded = false;

  constructor(source: SceneSource) {
    this.#source = source;
    this.#reader = decompressing(source.bytes, 'gzip');
  }

  /**
   * Inflates until there are `length` bytes in total, or the stream ends.
   * @returns All inflated bytes from the beginning of the file: `length`, more, or fewer if the stream has ended.
   * @throws GaussianSplatError `decode/truncated`, `decode/corrupt`, `out-of-memory/budget`; the reason of `signal`
   */
  async upTo(length: number): Promise<Uint8Array> {
    const { budget, name } = this.#source;
    // A growing buffer needs its size twice while its content is copied to a larger one.
    budget.take(2 * length, name);
    while (this.#output.length < length && !this.#isEnded) {
      this.#source.signal?.throwIfAborted();
      const { value } = await this.#reader
        .read()
        .catch((cause: unknown) => (isBehind(cause) ? this.#readMembers() : this.#fail(cause)));
      if (value) this.#output.append(value);
      else this.#isEnded = true;
    }
    return this.#output.view();
  }

  /** Stops inflating. */
  close(): void {
    this.#reader.cancel().catch(() => {});
  }

  /** Continues with a decoder of several members. That of a browser ends at the first, and drops content that is not read. */
  async #readMembers(): Promise<ReadableStreamReadResult<Uint8Array>> {
    const { readMembers } = await loadModule('the code that inflates gzip members', () => import('./gzip-members.js'));
    this.#reader = readMembers(this.#source.bytes, this.#output.length);
    return this.#reader.read();
  }

  #fail(cause: unknown): never {
    const { name, bytes } = this.#source;
    // Browsers distinguish truncated from damaged streams only by their messages.
    const isCut = /unexpected end|truncated|incomplete|ended/i.test(String((cause as Error).message));
    throw new GaussianSplatError(isCut ? 'decode/truncated' : 'decode/corrupt', {
      where: `${name}, ${isCut ? `byte ${grouped(bytes.length)} (end of the file)` : 'gzip stream'}`,
      expected: 'an intact gzip stream',
      found: isCut
        ? `one that is cut after ${grouped(this.#output.length)} inflated bytes`
        : `a damaged one after ${grouped(this.#output.length)} inflated bytes`,
      remedy: 'download or export the file again; it is incomplete',
      cause,
    });
  }
}
