import { BackOff } from '@gaussian-splat/core/fetch';
import { NONE } from './page-list.js';
import type { Residency } from './residency.js';

/** Pages being fetched at a time; a file holds up to five. */
export const MOST_FETCHES = 64;
/** Slots of pages being fetched or waiting for their upload, from which on no other is sent for: at most 31 MB of the page's memory, and one page of any size; where they lie in files with others, these files. */
export const MOST_UNDER_WAY = 240;
/** How much a page counts in the mean time of arrival when the next one has come. */
const MEMORY = 0.95;
/** Milliseconds before a page that did not come is asked for again; twice as long after each further failure, and after so many no more. */
const RETRY_MS = 4_000;
const MOST_TRIES = 8;
/** Milliseconds after a failure before those are tried again that had no room beside it: of many failures once. */
const ANEW_MS = 250;

/** A page that has come. */
export interface FetchedPage<Words> {
  readonly page: number;
  readonly words: Words;
}

export interface TrafficOptions<Words> {
  /** Rejects for a page that cannot be had. */
  readonly fetch: (page: number, signal: AbortSignal) => Promise<Words>;
  /** A page waits for its upload. */
  readonly onArrival: () => void;
  readonly onError: (error: unknown) => void;
  /** Milliseconds since any moment. Default: `performance.now`. */
  readonly now?: () => number;
}

/**
 * Pages on their way from the server to a slot: the most needed are sent for first and handed over first, a bounded number is under way, and what nobody wishes for any
 * more is given up wherever it is.
 */
export class PageTraffic<Words> {
  readonly #residency: Residency;
  readonly #options: TrafficOptions<Words>;
  readonly #fetching = new Map<number, AbortController>();
  readonly #waiting = new Map<number, Words>();
  /** Those that wait and are wished for, the most needed last; undefined if that has to be found anew. */
  #order: number[] | undefined;
  readonly #failures: BackOff<number>;
  #retry: ReturnType<typeof setTimeout> | undefined;
  #anew: ReturnType<typeof setTimeout> | undefined;
  readonly #sentAt = new Map<number, number>();
  readonly #now: () => number;
  #arrivalMs = 0;
  #slotsUnderWay = 0;
  #abandoned = 0;
  #isClosed = false;

  constructor(residency: Residency, options: TrafficOptions<Words>) {
    this.#residency = residency;
    this.#options = options;
    this.#now = options.now ?? (() => performance.now());
    this.#failures = new BackOff({ firstMs: RETRY_MS, factor: 2, mostTries: MOST_TRIES, now: options.now });
  }

  /** Pages being fetched or waiting. */
  get underWay(): number {
    return this.#fetching.size + this.#waiting.size;
  }

  /** Pages that wait for their upload. */
  get waiting(): number {
    return this.#waiting.size;
  }

  /** Pages sent for that were given up since, because nobody wished for them any more or nothing could leave for them. */
  get abandoned(): number {
    return this.#abandoned;
  }

  /** Milliseconds from when a page is sent for until it is handed over, as a mean of the last ones; 0 before any has been. */
  get arrivalMs(): number {
    return this.#arrivalMs;
  }

  /** To be called after each look: gives up what the last looks do not wish for and sends for what they do. */
  follow(): void {
    this.#order = undefined;
    for (const page of [...this.#fetching.keys(), ...this.#waiting.keys()]) {
      if (this.#residency.isStale(page)) this.#abandon(page);
    }
    this.sendForMore();
  }

  /** Sends for the pages that are needed most, as many as may be under way. */
  sendForMore(): void {
    while (!this.#isClosed && this.#fetching.size < MOST_FETCHES && this.#slotsUnderWay < MOST_UNDER_WAY) {
      const page = this.#residency.nextMissing();
      if (page === NONE) return;
      if (!this.#failures.isPaused(page) && this.#residency.begin(page)) void this.#bring(page);
    }
  }

  /** Hands over the most needed of the pages that wait; undefined if the last look wishes for none of them. */
  next(): FetchedPage<Words> | undefined {
    const most = this.#nextWaiting();
    if (most === undefined) return undefined;
    const words = this.#waiting.get(most)!;
    this.#waiting.delete(most);
    this.#slotsUnderWay -= this.#residency.slotsFor(most);
    this.#noteArrival(most);
    return { page: most, words };
  }

  /** A page that was handed over has found no slot. */
  refused(): void {
    this.#abandoned++;
  }

  /** Ends everything; nothing is reported any more. */
  close(): void {
    this.#isClosed = true;
    clearTimeout(this.#retry);
    clearTimeout(this.#anew);
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
    // The room that was kept for it is for others.
    this.#anew ??= setTimeout(() => {
      this.#anew = undefined;
      this.#askAnew();
    }, ANEW_MS);
  }

  /** A view at rest makes no look: what the last one wished for is asked for again all the same. */
  #retryLater(): void {
    this.#retry ??= setTimeout(() => {
      this.#retry = undefined;
      const { due, isMore } = this.#failures.takeDue();
      if (isMore) this.#retryLater();
      if (due.some((page) => this.#residency.need(page) > 0)) this.#askAnew();
    }, RETRY_MS);
  }

  /** Sends for what the last look wished for, whatever has been tried since. */
  #askAnew(): void {
    this.#residency.rebuildMissing();
    this.sendForMore();
  }

  #noteArrival(page: number): void {
    const took = this.#now() - this.#sentAt.get(page)!;
    this.#sentAt.delete(page);
    this.#arrivalMs = this.#arrivalMs === 0 ? took : MEMORY * this.#arrivalMs + (1 - MEMORY) * took;
  }

  #abandon(page: number): void {
    this.#fetching.get(page)?.abort();
    this.#fetching.delete(page);
    this.#waiting.delete(page);
    this.#sentAt.delete(page);
    this.#slotsUnderWay -= this.#residency.slotsFor(page);
    this.#residency.cancel(page);
    this.#abandoned++;
  }

  async #bring(page: number): Promise<void> {
    const controller = new AbortController();
    this.#fetching.set(page, controller);
    this.#sentAt.set(page, this.#now());
    this.#slotsUnderWay += this.#residency.slotsFor(page);
    // A page that was given up may have been sent for again meanwhile: that is another fetch.
    const isOver = (): boolean => this.#fetching.get(page) !== controller;
    try {
      const words = await this.#options.fetch(page, controller.signal);
      if (isOver()) return;
      this.#waiting.set(page, words);
      this.#order = undefined;
      this.#failures.succeed(page);
    } catch (error) {
      if (isOver()) return;
      this.#slotsUnderWay -= this.#residency.slotsFor(page);
      this.#residency.cancel(page);
      this.#sentAt.delete(page);
      this.#noteFailure(page, error);
    }
    this.#fetching.delete(page);
    this.sendForMore();
    // Of a page that does not come there is nothing to draw.
    if (this.#waiting.has(page)) this.#options.onArrival();
  }
}
