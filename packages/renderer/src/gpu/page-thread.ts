/** The page's one thread: a turn on it for others, and when it was last blocked. */

/** Lets other tasks have the thread. Timers would wait long where the page is hidden. */
export function turn(): Promise<void> {
  const { port1, port2 } = new MessageChannel();
  return new Promise((resolve) => {
    port1.onmessage = () => {
      port1.close();
      resolve();
    };
    port2.postMessage(null);
  });
}

/** Milliseconds between two looks whether the page's thread is free, and by which they may be late. */
const BEAT_MS = 4;
const LATE_MS = 2;

/** When the page was told of something. */
export interface Told {
  readonly now: number;
  /** The earliest moment at which it may have been so: another where the thread was busy until then. */
  readonly since: number;
}

/** Knows when the page's thread was last blocked, as long as somebody waits: what is told then is told late. */
class ThreadWatch {
  #waiting = 0;
  #timer: ReturnType<typeof setTimeout> | undefined;
  /** When the last look was and the next one is due, and when the last block began, at the earliest, and ended. */
  #looked = 0;
  #due = 0;
  #block = { from: -Infinity, to: -Infinity };

  async during(waiting: Promise<unknown>): Promise<Told> {
    this.#waiting++;
    if (this.#timer === undefined) this.#next(0);
    try {
      await waiting;
      const now = performance.now();
      this.#note(now);
      const { from, to } = this.#block;
      return { now, since: now - to < LATE_MS ? from : now };
    } finally {
      if (--this.#waiting === 0) {
        clearTimeout(this.#timer);
        this.#timer = undefined;
      }
    }
  }

  #next(milliseconds: number): void {
    this.#looked = performance.now();
    this.#due = this.#looked + milliseconds;
    this.#timer = setTimeout(this.#beat, milliseconds);
  }

  #note(now: number): void {
    if (now > this.#due + LATE_MS) this.#block = { from: this.#looked, to: now };
  }

  readonly #beat = (): void => {
    this.#note(performance.now());
    this.#next(BEAT_MS);
  };
}

/** One for the page: it has one thread. */
export const threadWatch = new ThreadWatch();
