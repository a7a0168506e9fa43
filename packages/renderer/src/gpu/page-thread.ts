/** The main thread: yields to other tasks, and records when it was last blocked. */

/** Resolves after other tasks of the thread have run. Uses a message, because browsers delay timers on hidden pages. */
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

/** Milliseconds between checks whether the main thread is free. */
const BEAT_MS = 4;
/** Maximum delay of a check in milliseconds that does not count as blocked. */
const LATE_MS = 2;

/** Time of a notification on the main thread, in milliseconds as `performance.now()` returns. */
export interface ObservedTime {
  readonly now: number;
  /** Earliest possible time of the event. It is earlier than `now` if the thread was blocked until the notification. */
  readonly since: number;
}

/** Records when the main thread was last blocked while a promise is awaited, because its notification is late then. */
class ThreadWatch {
  #waiting = 0;
  #timer: ReturnType<typeof setTimeout> | undefined;
  /** Time of the last check. */
  #looked = 0;
  /** Due time of the next check. */
  #due = 0;
  /** Beginning, at the earliest, and end of the last period when the thread was blocked. */
  #block = { from: -Infinity, to: -Infinity };

  /** Waits for a promise, and resolves to the time of its notification. */
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

/** The watch of this page, which has one main thread. */
export const threadWatch = new ThreadWatch();
