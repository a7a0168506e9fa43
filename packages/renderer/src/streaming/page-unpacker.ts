import type { FetchedPage } from './page-streamer.js';
import type { SlotWords } from './slot-words.js';

/** Maximum number of quantized slots that one task unpacks: 16,384 splats, which take several milliseconds. */
export const UNPACKED_AT_ONCE = 16;
/** Number of unpacked slots that may wait, unless a page has more: 2 MB of geometry. */
export const MAX_UNPACKED = 64;
/** Factor of both numbers for slots that are in float32 already: copying them takes a tenth of the time. */
export const EXACT = 4;

type ArrivedPage = FetchedPage<readonly SlotWords[]>;

/** A page with all of its slots unpacked. */
export interface UnpackedPage<Part> extends ArrivedPage {
  readonly parts: readonly Part[];
}

/**
 * Unpacks arrived pages slot by slot, because a page may have a hundred thousand splats: no task unpacks more than
 * {@link UNPACKED_AT_ONCE} slots.
 */
export class PageUnpacker<Part> {
  readonly #next: () => ArrivedPage | undefined;
  readonly #unpack: (words: SlotWords, page: number) => Part;
  readonly #factor: number;
  #ready: UnpackedPage<Part>[] = [];
  #current: (ArrivedPage & { readonly parts: Part[] }) | undefined;

  /**
   * @param next Returns the most needed page that has arrived; undefined if there is none.
   * @param unpack Unpacks a slot of a page.
   * @param factor Of {@link UNPACKED_AT_ONCE} and {@link MAX_UNPACKED}.
   */
  constructor(next: () => ArrivedPage | undefined, unpack: (words: SlotWords, page: number) => Part, factor = 1) {
    this.#next = next;
    this.#unpack = unpack;
    this.#factor = factor;
  }

  /** Whether a page is unpacked. */
  get hasReady(): boolean {
    return this.#ready.length > 0;
  }

  /** Number of pages that are unpacked, or are being unpacked. */
  get count(): number {
    return this.#ready.length + (this.#current ? 1 : 0);
  }

  /** Unpacks some slots of the most needed pages. Call this once in a task. */
  step(): void {
    let waiting = this.#ready.reduce((sum, { parts }) => sum + parts.length, 0);
    for (let left = this.#factor * UNPACKED_AT_ONCE; left > 0; left--) {
      if (!this.#current && waiting < this.#factor * MAX_UNPACKED) this.#begin();
      const current = this.#current;
      if (!current) return;
      const { page, words, parts } = current;
      if (parts.length < words.length) parts.push(this.#unpack(words[parts.length], page));
      if (parts.length < words.length) continue;
      this.#ready.push(current);
      waiting += parts.length;
      this.#current = undefined;
    }
  }

  /** Removes and returns the unpacked pages, the most needed first. */
  take(): readonly UnpackedPage<Part>[] {
    const ready = this.#ready;
    this.#ready = [];
    return ready;
  }

  #begin(): void {
    const next = this.#next();
    this.#current = next && { ...next, parts: [] };
  }
}
