/** The main thread: yields to other tasks, and records when it was last blocked. */

/** Yields to other tasks. A message is used because timers are delayed on hidden pages. */
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

/** Interval of the checks whether the main thread is free, in ms, and their tolerated delay. */
const BEAT_MS = 4;
const LATE_MS = 2;

/** Notification on the main thread, ms. */
export interface ObservedTime {
  readonly now: number;
  /** Earliest possible time of the event: earlier than `now` if the thread was busy until then. */
  readonly since: number;
}

/** Records when the main thread was last blocked while anything is awaited, because notifications are late then. */
class ThreadWatch {
  #waiting = 0;
  #timer: ReturnType<typeof setTimeout> | undefined;
  /** Time of the last check and due time of the next; earliest begin and the end of the last block. */
  #looked = 0;
  #due = 0;
  #block = { from: -Infinity, to: -Infinity };

  async during(waiting: Promise<unknown>): Promise<ObservedTime> {
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

/** One for the page, because it has one main thread. */
export const threadWatch = new ThreadWatch();
