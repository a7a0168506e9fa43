import type { QueueClock } from '@gaussian-splat/renderer';

/** How long a frame kept the GPU, ms: one figure where the page's thread was free when it was done. */
export interface FrameTime {
  /** When it was done, by the page's clock. */
  readonly doneAt: number;
  readonly atLeast: number;
  readonly atMost: number;
}

/** Milliseconds between two looks whether the page's thread is free, and by which they may be late. */
const BEAT_MS = 4;
const LATE_MS = 2;

/** Knows when the page's thread was last blocked, as long as somebody waits: what is told then is told late. */
class ThreadWatch {
  #waiting = 0;
  #timer: ReturnType<typeof setTimeout> | undefined;
  /** When the last look was and the next one is due, and when the last block began, at the earliest, and ended. */
  #looked = 0;
  #due = 0;
  #block = { from: 0, to: 0 };

  /** Waits. @returns when that was over, and since when it may have been */
  async during(waiting: Promise<number>): Promise<{ now: number; since: number }> {
    this.#waiting++;
    if (this.#timer === undefined) this.#next(0);
    try {
      const now = await waiting;
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
const thread = new ThreadWatch();

/**
 * How long frames keep the GPU, by when their work is done: from when a frame could begin, which is when it was submitted and all that came before was done, whoever
 * submitted that. Figures come when the frame is done; nothing waits, nothing is submitted.
 */
export class FrameMeter {
  readonly #clock: QueueClock;

  constructor(clock: QueueClock) {
    this.#clock = clock;
  }

  /** @param draw submits the frame */
  measure(draw: () => void, onTime: (time: FrameTime) => void): void {
    const clock = this.#clock;
    const before = thread.during(clock.done());
    draw();
    const submitted = performance.now();
    Promise.all([before, thread.during(clock.done())]).then(
      ([began, done]) => {
        clock.note(done.now - submitted);
        const atMost = clock.spent(began.since, submitted, done.now);
        const atLeast = Math.min(atMost, clock.spent(began.now, submitted, done.since));
        onTime({ doneAt: done.now, atLeast, atMost });
      },
      // A lost device has been noticed elsewhere.
      () => undefined,
    );
  }
}
