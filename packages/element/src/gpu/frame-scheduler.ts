import { DisplayInterval } from '../dynamic-quality/display-interval.js';

/** Something that draws. */
export interface FrameClient {
  /** Draws one frame. Asks the scheduler again if there is to be another. `now` is requestAnimationFrame's clock, ms. */
  drawFrame(now: number): void;
}

/** Frames until who draws besides counts in full: who draws now and then takes little of what there is. Who draws no more does not count. */
const MEMORY = 8;

/** When a picture was last drawn in any window, by the page's clock. */
let lastDrawn = -Infinity;

/** Share of the display's interval that frames may take: the page and its compositor need the rest. */
const SHARE_OF_INTERVAL = 0.8;

/** What a frame may take on the GPU, ms: what the page says, else a share of the display's interval, which elements that draw at the same time share. */
export const targetMsOf = (
  budgetMs: number,
  { displayInterval, clients }: Pick<FrameScheduler, 'displayInterval' | 'clients'>,
): number => (budgetMs < Infinity ? budgetMs : (SHARE_OF_INTERVAL * displayInterval) / clients);

/** Milliseconds since a picture was last drawn in any window. */
export const sinceLastPicture = (): number => performance.now() - lastDrawn;

/** Of each window that elements are in. */
const KNOWN = new WeakMap<Window, FrameScheduler>();

/** One requestAnimationFrame loop for all elements of a window; it runs only while one of them has asked for a frame. */
export class FrameScheduler {
  readonly #window: Window;
  #due = new Set<FrameClient>();
  #drawing = new Set<FrameClient>();
  #handle = 0;
  #waitsForPage = false;
  readonly #interval = new DisplayInterval();
  #clients = 1;

  /** @param view the window whose pictures are drawn; default the page's own */
  constructor(view: Window = globalThis as unknown as Window) {
    this.#window = view;
  }

  /** The one of a window. */
  static of(view: Window): FrameScheduler {
    const known = KNOWN.get(view) ?? new FrameScheduler(view);
    KNOWN.set(view, known);
    return known;
  }

  /** Milliseconds between two pictures of the display. */
  get displayInterval(): number {
    return this.#interval.milliseconds;
  }

  /** Clients that draw at the same time, frame after frame: 1 or more. */
  get clients(): number {
    return this.#clients;
  }

  /** Asks for one frame; asking twice is asking once. */
  request(client: FrameClient): void {
    this.#due.add(client);
    this.#schedule();
  }

  /** Takes back what was asked for. */
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
    // Clocks of windows begin when they are opened.
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
        // One element's fault must not stop the others.
        reportError(error);
      }
    }
    this.#drawing.clear();
  }
}
