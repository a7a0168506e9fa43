import { DisplayInterval } from '../dynamic-quality/display-interval.js';

/** A client of the scheduler that draws frames. */
export interface FrameClient {
  /**
   * Draws one frame, and requests another one from the scheduler if needed. `now` is requestAnimationFrame's clock, ms.
   */
  drawFrame(now: number): void;
}

/**
 * Number of frames over which the number of clients is smoothed when it grows, because clients that draw occasionally
 * take little time. Clients that have stopped are not counted.
 */
const MEMORY = 8;

/** Time of the last frame in any window, in milliseconds of the page's `performance.now()`. */
let lastDrawn = -Infinity;

/** Fraction of the display interval that frames may take, because the page and its compositor need the rest. */
const SHARE_OF_INTERVAL = 0.8;

/**
 * Returns the target GPU duration of a frame, ms. It is the limit that the page sets, if finite. Otherwise it is a
 * fraction of the display interval, divided by the number of clients that draw at the same time.
 */
export const targetMsOf = (
  budgetMs: number,
  { displayInterval, clients }: Pick<FrameScheduler, 'displayInterval' | 'clients'>,
): number => (budgetMs < Infinity ? budgetMs : (SHARE_OF_INTERVAL * displayInterval) / clients);

/** Returns the milliseconds since the last frame in any window; Infinity before the first. */
export const sinceLastImage = (): number => performance.now() - lastDrawn;

/** The schedulers of windows with elements. */
const KNOWN = new WeakMap<Window, FrameScheduler>();

/** A requestAnimationFrame loop for all elements of a window. It runs only while an element has requested a frame. */
export class FrameScheduler {
  readonly #window: Window;
  #due = new Set<FrameClient>();
  #drawing = new Set<FrameClient>();
  #handle = 0;
  readonly #interval = new DisplayInterval();
  #clients = 1;

  /** @param view The window whose requestAnimationFrame is used; default: the page's own. */
  constructor(view: Window = globalThis as unknown as Window) {
    this.#window = view;
  }

  /** Returns the scheduler of a window. */
  static of(view: Window): FrameScheduler {
    const known = KNOWN.get(view) ?? new FrameScheduler(view);
    KNOWN.set(view, known);
    return known;
  }

  /** Interval between two refreshes of the display, ms. */
  get displayInterval(): number {
    return this.#interval.milliseconds;
  }

  /** Smoothed number of clients that draw in the same frames, 1 or more. */
  get clients(): number {
    return this.#clients;
  }

  /** Requests one frame for a client. Repeated requests before that frame count once. */
  request(client: FrameClient): void {
    this.#due.add(client);
    this.#schedule();
  }

  /** Cancels the request of a client. */
  cancel(client: FrameClient): void {
    this.#due.delete(client);
    this.#drawing.delete(client);
    if (this.#due.size > 0 || this.#handle === 0) return;
    this.#window.cancelAnimationFrame(this.#handle);
    this.#handle = 0;
  }

  #schedule(): void {
    if (this.#handle !== 0 || this.#due.size === 0) return;
    const { document } = this.#window;
    // A listener that is added again counts once.
    if (document.visibilityState === 'hidden')
      document.addEventListener('visibilitychange', this.#onVisible, { once: true });
    else this.#handle = this.#window.requestAnimationFrame(this.#tick);
  }

  readonly #onVisible = (): void => this.#schedule();

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
