import { DisplayInterval } from '../dynamic-quality/display-interval.js';

/** A client that draws. */
export interface FrameClient {
  /** Draws one frame. Requests the next one from the scheduler if needed. `now` is requestAnimationFrame's clock, ms. */
  drawFrame(now: number): void;
}

/**
 * Frames until another client counts fully: clients that draw occasionally take little of the time. Clients that have
 * stopped do not count.
 */
const MEMORY = 8;

/** Time of the last frame in any window, by the page's clock. */
let lastDrawn = -Infinity;

/** Fraction of the display interval for frames: the page and its compositor need the rest. */
const SHARE_OF_INTERVAL = 0.8;

/**
 * Target GPU duration of a frame, ms: the page's limit, else a fraction of the display interval, divided among elements
 * that draw at the same time.
 */
export const targetMsOf = (
  budgetMs: number,
  { displayInterval, clients }: Pick<FrameScheduler, 'displayInterval' | 'clients'>,
): number => (budgetMs < Infinity ? budgetMs : (SHARE_OF_INTERVAL * displayInterval) / clients);

/** Milliseconds since the last frame in any window. */
export const sinceLastImage = (): number => performance.now() - lastDrawn;

/** Scheduler of each window with elements. */
const KNOWN = new WeakMap<Window, FrameScheduler>();

/** One requestAnimationFrame loop for all elements of a window; it runs only while an element has requested a frame. */
export class FrameScheduler {
  readonly #window: Window;
  #due = new Set<FrameClient>();
  #drawing = new Set<FrameClient>();
  #handle = 0;
  #waitsForPage = false;
  readonly #interval = new DisplayInterval();
  #clients = 1;

  /** @param view The window whose frames are drawn; default the page's own. */
  constructor(view: Window = globalThis as unknown as Window) {
    this.#window = view;
  }

  /** Returns the scheduler of a window. */
  static of(view: Window): FrameScheduler {
    const known = KNOWN.get(view) ?? new FrameScheduler(view);
    KNOWN.set(view, known);
    return known;
  }

  /** Milliseconds between two frames of the display. */
  get displayInterval(): number {
    return this.#interval.milliseconds;
  }

  /** Number of clients that draw at the same time, frame after frame: at least 1. */
  get clients(): number {
    return this.#clients;
  }

  /** Requests one frame; repeated requests count once. */
  request(client: FrameClient): void {
    this.#due.add(client);
    this.#schedule();
  }

  /** Cancels a request. */
  cancel(client: FrameClient): void {
    this.#due.delete(client);
    this.#drawing.delete(client);
    if (this.#due.size > 0 || this.#handle === 0) return;
    this.#window.cancelAnimationFrame(this.#handle);
    this.#handle = 0;
  }

  #schedule(): void {
    if (this.#handle !== 0 || this.#due.size === 0) return;
    if (this.#window.document.visibilityState === 'hidden') this.#waitForPage();
    else this.#handle = this.#window.requestAnimationFrame(this.#tick);
  }

  #waitForPage(): void {
    if (this.#waitsForPage) return;
    this.#waitsForPage = true;
    const resume = (): void => {
      this.#waitsForPage = false;
      this.#schedule();
    };
    this.#window.document.addEventListener('visibilitychange', resume, { once: true });
  }

  readonly #tick = (time: number): void => {
    this.#handle = 0;
    // Each window has its own clock origin.
    const now =
      this.#window === (globalThis as unknown as Window)
        ? time
        : time + this.#window.performance.timeOrigin - performance.timeOrigin;
    if (this.#window.document.visibilityState !== 'hidden') this.#drawAll(now);
    this.#schedule();
    if (this.#handle === 0) this.#interval.pause();
  };

  #drawAll(now: number): void {
    lastDrawn = performance.now();
    [this.#due, this.#drawing] = [this.#drawing, this.#due];
    const { size } = this.#drawing;
    this.#clients = Math.min(size, this.#clients + (size - this.#clients) / MEMORY);
    this.#interval.tick(now);
    for (const client of this.#drawing) {
      try {
        client.drawFrame(now);
      } catch (error) {
        // A fault of one element must not stop the others.
        reportError(error);
      }
    }
    this.#drawing.clear();
  }
}
