import { BackOff } from '@gaussian-splat/core/fetch';
import { NONE } from './page-list.js';
import type { Residency } from './residency.js';

/** Maximum number of concurrent fetches; a file contains up to five pages. */
export const MAX_FETCHES = 64;
/**
 * Maximum bytes of CPU memory of the pages in transit, beside one page of any size: the words of arrived pages, and twice
 * the words of pages that are being fetched, for their files.
 */
export const MAX_TRANSIT_BYTES = 32e6;
/** Weight of the previous mean arrival time in an update. */
const MEMORY = 0.95;
/** Milliseconds before a failed page is requested again; doubled after each further failure. */
const RETRY_MS = 4_000;
/** Maximum number of attempts for a page. */
const MAX_TRIES = 8;
/** Milliseconds after a failure before pages that did not fit are tried again: once for all failures in this time. */
const RECHECK_MS = 250;

/** A fetched page. */
export interface FetchedPage<Words> {
  readonly page: number;
  readonly words: Words;
}

/** Options of a {@link PageStreamer}. */
export interface TrafficOptions<Words> {
  /** Bytes of a slot. */
  readonly slotBytes: number;
  /** Fetches a page; rejects if the page is unavailable. */
  readonly fetch: (page: number, signal: AbortSignal) => Promise<Words>;
  /** Called when a page has arrived and waits for its upload. */
  readonly onArrival: () => void;
  /** Called at the first failure of a page. */
  readonly onError: (error: unknown) => void;
  /** Returns the current time in milliseconds, from any origin. Default: `performance.now`. */
  readonly now?: () => number;
}

/**
 * Streams pages from the server to slots. The most needed pages are fetched and uploaded first. The number of pages in
 * transit is limited, and pages that are no longer requested are canceled at any stage.
 */
export class PageStreamer<Words> {
  readonly #residency: Residency;
  readonly #options: TrafficOptions<Words>;
  readonly #fetching = new Map<number, AbortController>();
  readonly #waiting = new Map<number, Words>();
  /** Requested pages that wait for their upload, the most needed last; undefined if the list must be rebuilt. */
  #order: number[] | undefined;
  readonly #failures: BackOff<number>;
  #retry: ReturnType<typeof setTimeout> | undefined;
  #recheckTimer: ReturnType<typeof setTimeout> | undefined;
  /** Time of the request of each page in transit, and its bytes of CPU memory. */
  readonly #sent = new Map<number, { readonly at: number; bytes: number }>();
  readonly #now: () => number;
  #arrivalMs = 0;
  #bytes = 0;
  #abandoned = 0;
  #isClosed = false;

  constructor(residency: Residency, options: TrafficOptions<Words>) {
    this.#residency = residency;
    this.#options = options;
    this.#now = options.now ?? (() => performance.now());
    this.#failures = new BackOff({ firstMs: RETRY_MS, factor: 2, maxTries: MAX_TRIES, now: options.now });
  }

  /** Number of pages that are being fetched or wait for their upload. */
  get underWay(): number {
    return this.#fetching.size + this.#waiting.size;
  }

  /** Bytes of CPU memory of these pages; those of a fetch are expected. */
  get bytes(): number {
    return this.#bytes;
  }

  /** Number of pages that wait for their upload. */
  get waiting(): number {
    return this.#waiting.size;
  }

  /**
   * Number of fetches that were canceled or whose page was discarded: it was no longer requested, or no page could be
   * evicted for it.
   */
  get abandoned(): number {
    return this.#abandoned;
  }

  /**
   * Mean milliseconds from the request of a page to its upload, weighted toward the latest pages; 0 before the first.
   */
  get arrivalMs(): number {
    return this.#arrivalMs;
  }

  /** Cancels pages that are no longer requested, and fetches new ones: call it after each feedback pass. */
  follow(): void {
    this.#order = undefined;
    for (const page of [...this.#fetching.keys(), ...this.#waiting.keys()]) {
      if (this.#residency.isStale(page)) this.#abandon(page);
    }
    this.sendForMore();
  }

  /** Fetches the most needed missing pages, up to the limits. */
  sendForMore(): void {
    while (!this.#isClosed && this.#fetching.size < MAX_FETCHES && this.#bytes < MAX_TRANSIT_BYTES) {
      const page = this.#residency.nextMissing();
      if (page === NONE) return;
      if (!this.#failures.isPaused(page) && this.#residency.begin(page)) void this.#bring(page);
    }
  }

  /** Removes and returns the most needed page that waits for its upload; undefined if no waiting page is requested. */
  next(): FetchedPage<Words> | undefined {
    const max = this.#nextWaiting();
    if (max === undefined) return undefined;
    const words = this.#waiting.get(max)!;
    this.#waiting.delete(max);
    this.#noteArrival(max);
    return { page: max, words };
  }

  /** Counts a page of {@link next} that found no slot as abandoned. */
  refused(): void {
    this.#abandoned++;
  }

  /** Aborts all fetches and stops all timers; no callbacks follow. */
  close(): void {
    this.#isClosed = true;
    clearTimeout(this.#retry);
    clearTimeout(this.#recheckTimer);
    for (const controller of this.#fetching.values()) controller.abort();
    this.#fetching.clear();
    this.#waiting.clear();
  }

  #nextWaiting(): number | undefined {
    const need = (page: number): number => this.#residency.need(page);
    this.#order ??= [...this.#waiting.keys()].filter((page) => need(page) > 0).sort((a, b) => need(a) - need(b));
    return this.#order.pop();
  }

  #noteFailure(page: number, error: unknown): void {
    if (this.#failures.fail(page) === 1) this.#options.onError(error);
    this.#retryLater();
    // Pages that did not fit may use the slots that the failed page had reserved.
    this.#recheckTimer ??= setTimeout(() => {
      this.#recheckTimer = undefined;
      this.#recheck();
    }, RECHECK_MS);
  }

  /** Repeats the last requests later, because a view at rest runs no feedback pass. */
  #retryLater(): void {
    this.#retry ??= setTimeout(() => {
      this.#retry = undefined;
      const { due, isMore } = this.#failures.takeDue();
      if (isMore) this.#retryLater();
      if (due.some((page) => this.#residency.need(page) > 0)) this.#recheck();
    }, RETRY_MS);
  }

  /** Repeats all requests of the last feedback pass, including those for failed pages. */
  #recheck(): void {
    this.#residency.rebuildMissing();
    this.sendForMore();
  }

  /** Ends the transit of a page. @returns The time of its request. */
  #takeSent(page: number): number {
    const { at, bytes } = this.#sent.get(page)!;
    this.#sent.delete(page);
    this.#bytes -= bytes;
    return at;
  }

  #wordBytes(page: number): number {
    return this.#options.slotBytes * this.#residency.slotsFor(page);
  }

  #noteArrival(page: number): void {
    const took = this.#now() - this.#takeSent(page);
    this.#arrivalMs = this.#arrivalMs === 0 ? took : MEMORY * this.#arrivalMs + (1 - MEMORY) * took;
  }

  #abandon(page: number): void {
    this.#fetching.get(page)?.abort();
    this.#fetching.delete(page);
    this.#waiting.delete(page);
    this.#takeSent(page);
    this.#residency.cancel(page);
    this.#abandoned++;
  }

  async #bring(page: number): Promise<void> {
    const controller = new AbortController();
    this.#fetching.set(page, controller);
    const sent = { at: this.#now(), bytes: 2 * this.#wordBytes(page) };
    this.#sent.set(page, sent);
    this.#bytes += sent.bytes;
    // A canceled page may have been requested again meanwhile, which is a separate fetch.
    const isOver = (): boolean => this.#fetching.get(page) !== controller;
    try {
      const words = await this.#options.fetch(page, controller.signal);
      if (isOver()) return;
      this.#waiting.set(page, words);
      // The file is no longer needed, and the number of slots may have been a guess.
      this.#bytes += this.#wordBytes(page) - sent.bytes;
      sent.bytes = this.#wordBytes(page);
      this.#order = undefined;
      this.#failures.succeed(page);
    } catch (error) {
      if (isOver()) return;
      this.#takeSent(page);
      this.#residency.cancel(page);
      this.#noteFailure(page, error);
    }
    this.#fetching.delete(page);
    this.sendForMore();
    // A failed page has no words, and needs no frame.
    if (this.#waiting.has(page)) this.#options.onArrival();
  }
}
