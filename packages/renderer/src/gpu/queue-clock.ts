import { perDevice } from './kernel.js';
import { threadWatch, type ObservedTime } from './page-thread.js';

/** Number of empty submissions in a calibration. The fastest one is the latency of an idle GPU. */
const TRIES = 4;
/** Duration of the validity of a calibration in milliseconds. */
const VALID_MS = 60_000;

/** Maximum milliseconds between two notifications if the first may have been delayed until the second. */
const TOGETHER_MS = 1;

/**
 * Bounds of the GPU time of some work, in milliseconds. They are equal if the main thread was free when the work
 * finished.
 */
export interface WorkTime {
  /** Completion time of the work, as `performance.now()` returns. */
  readonly doneAt: number;
  readonly lowerBound: number;
  readonly upperBound: number;
}

/**
 * Measures the duration of work as a page experiences it: until the queue reports completion, minus the latency of an
 * empty submission. GPU timestamps exclude the browser's work between passes, which can be most of a frame. The clock
 * never blocks, and submits only for calibration.
 */
export class QueueClock {
  /**
   * Whether other code also submits to the queue without this clock. The completion of its work is then queried before
   * each frame.
   */
  isShared = false;
  readonly #device: GPUDevice;
  #latency = Infinity;
  #measuredAt = -Infinity;
  /** Last known completion time of submitted work. */
  #last: ObservedTime = { now: -Infinity, since: -Infinity };
  /**
   * Work that was reported at about the same time: time of the report, number of items, and their total milliseconds.
   */
  #together = { now: -Infinity, count: 0, milliseconds: 0 };

  /** Returns the clock of a device. */
  static of(device: GPUDevice): QueueClock {
    return perDevice(device, 'queue clock', () => new QueueClock(device));
  }

  private constructor(device: GPUDevice) {
    this.#device = device;
  }

  /** Latency of an empty submission in ms; 0 until it is measured. */
  get latency(): number {
    return this.#latency < Infinity ? this.#latency : 0;
  }

  /**
   * Measures the latency with four empty submissions, unless the last measurement is still valid. Call this while the
   * GPU is idle.
   */
  async calibrate(): Promise<void> {
    if (performance.now() - this.#measuredAt < VALID_MS) return;
    this.#measuredAt = performance.now();
    const times: number[] = [];
    for (let i = 0; i < TRIES; i++) {
      const begin = performance.now();
      this.#device.queue.submit([this.#device.createCommandEncoder({ label: 'gs.clock' }).finish()]);
      times.push((await this.done()).now - begin);
    }
    this.#latency = Math.min(...times);
  }

  /**
   * Waits for all submitted work.
   * @returns The time of the notification, and in `before` that of the previous one. Rejects if the device is lost.
   */
  async done(): Promise<ObservedTime & { readonly before: ObservedTime }> {
    const observed = await threadWatch.during(this.#device.queue.onSubmittedWorkDone());
    const before = this.#last;
    this.#last = observed;
    return { ...observed, before };
  }

  /**
   * Measures the GPU time of the work that `submit` submits. Rejects if the device is lost.
   * @throws the errors of `submit`, before the method returns
   */
  time(submit: () => void): Promise<WorkTime> {
    if (this.isShared) this.done().catch(() => undefined);
    submit();
    return this.#timeSince(performance.now());
  }

  async #timeSince(submitted: number): Promise<WorkTime> {
    const { now, since, before } = await this.done();
    // A shorter time than ever before is a better estimate of the latency.
    this.#latency = Math.min(this.#latency, now - submitted);
    const upperBound = this.spent(before.since, submitted, now);
    const lowerBound = Math.min(upperBound, this.spent(before.now, submitted, since));
    // The first of several results reported together seems to take the time of all; each gets an equal part.
    const isTogether = before.now > submitted && now - this.#together.now < TOGETHER_MS;
    const together = isTogether ? this.#together : (this.#together = { now, count: 0, milliseconds: 0 });
    together.count++;
    together.milliseconds += upperBound;
    await new Promise((resolve) => setTimeout(resolve));
    if (together.count === 1) return { doneAt: now, lowerBound, upperBound };
    const share = together.milliseconds / together.count;
    return { doneAt: now, lowerBound: Math.min(lowerBound, share), upperBound: share };
  }

  /**
   * Returns the milliseconds of GPU time of some work. Work starts after its submission, and after the completion of
   * earlier work.
   * @param before Completion time of the earlier work.
   * @param submitted Time of the submission of this work.
   * @param done Completion time of this work.
   */
  spent(before: number, submitted: number, done: number): number {
    return Math.max(0, Math.min(done - before, done - submitted - this.latency));
  }
}
