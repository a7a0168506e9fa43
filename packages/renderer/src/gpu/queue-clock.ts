import { perDevice } from './kernel.js';
import { threadWatch, type Told } from './page-thread.js';

/** Empty submissions of which the fastest tells how long a GPU with nothing to do takes to say so. */
const TRIES = 4;
/** What that takes is measured anew after so long, ms. */
const VALID_MS = 60_000;

/** Answers so soon after one another, ms, may have waited for the later one. */
const TOGETHER_MS = 1;

/** How long work kept the GPU, ms: one figure where the page's thread was free when it was done. */
export interface WorkTime {
  /** When it was done, by the page's clock. */
  readonly doneAt: number;
  readonly atLeast: number;
  readonly atMost: number;
}

/**
 * Times work as a page waits for it: until the queue says that it is done, less what waiting for nothing takes. The time between a GPU's own timestamps leaves out what the browser
 * does between passes, which can be most of a frame. Nothing waits for it, and nothing is submitted but to calibrate.
 */
export class QueueClock {
  /** Others, who do not wait by this clock, work on the queue, too: when their work is done is asked before each frame. */
  isShared = false;
  readonly #device: GPUDevice;
  #latency = Infinity;
  #measuredAt = -Infinity;
  /** When what was submitted was last known to be done. */
  #last: Told = { now: -Infinity, since: -Infinity };
  /** Work that was told of at about one moment: since when, how much of it, and what all of it took, ms. */
  #together = { now: -Infinity, count: 0, milliseconds: 0 };

  /** The one of a device. */
  static of(device: GPUDevice): QueueClock {
    return perDevice(device, 'queue clock', () => new QueueClock(device));
  }

  private constructor(device: GPUDevice) {
    this.#device = device;
  }

  /** Milliseconds that waiting for nothing takes; 0 until that is known. */
  get latency(): number {
    return this.#latency < Infinity ? this.#latency : 0;
  }

  /** Measures what waiting for nothing takes, by a few empty submissions, unless that was done of late. Call it where the GPU has nothing to do. */
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

  /** Waits until all that was submitted is done. @returns when the page was notified, and when of what was done before */
  async done(): Promise<Told & { readonly before: Told }> {
    const told = await threadWatch.during(this.#device.queue.onSubmittedWorkDone());
    const before = this.#last;
    this.#last = told;
    return { ...told, before };
  }

  /** Times what `submit` submits. Rejects where the device is lost. */
  async time(submit: () => void): Promise<WorkTime> {
    if (this.isShared) this.done().catch(() => undefined);
    submit();
    const submitted = performance.now();
    const { now, since, before } = await this.done();
    // No work takes less than none.
    this.#latency = Math.min(this.#latency, now - submitted);
    const atMost = this.spent(before.since, submitted, now);
    const atLeast = Math.min(atMost, this.spent(before.now, submitted, since));
    // Of work that is told of together the first seems to take the time of all.
    const isTogether = before.now > submitted && now - this.#together.now < TOGETHER_MS;
    const together = isTogether ? this.#together : (this.#together = { now, count: 0, milliseconds: 0 });
    together.count++;
    together.milliseconds += atMost;
    await new Promise((resolve) => setTimeout(resolve));
    if (together.count === 1) return { doneAt: now, atLeast, atMost };
    const share = together.milliseconds / together.count;
    return { doneAt: now, atLeast: Math.min(atLeast, share), atMost: share };
  }

  /**
   * Milliseconds that work kept the GPU: from when it could begin, which is when it was submitted and what came before was done.
   * @param before when that was known to be done
   * @param done when the work itself was
   */
  spent(before: number, submitted: number, done: number): number {
    return Math.max(0, Math.min(done - before, done - submitted - this.latency));
  }
}
