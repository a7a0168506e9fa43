import { perDevice } from './kernel.js';

/** Empty submissions of which the fastest tells how long a GPU with nothing to do takes to say so. */
const TRIES = 4;
/** What that takes is measured anew after so long, ms. */
const VALID_MS = 60_000;

/**
 * Times work as a page waits for it: until the queue says that it is done, less what waiting for nothing takes. The time between a GPU's own timestamps leaves out what the browser
 * does between passes, which can be most of a frame.
 */
export class QueueClock {
  readonly #device: GPUDevice;
  #latency = Infinity;
  #measuredAt = -Infinity;

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
    const { queue } = this.#device;
    if (performance.now() - this.#measuredAt < VALID_MS) return;
    this.#measuredAt = performance.now();
    const times: number[] = [];
    for (let i = 0; i < TRIES; i++) {
      const begin = performance.now();
      queue.submit([this.#device.createCommandEncoder({ label: 'gs.clock' }).finish()]);
      times.push((await this.done()) - begin);
    }
    this.#latency = Math.min(...times);
  }

  /** Waits until all that was submitted is done. @returns when that was known, by the page's clock */
  async done(): Promise<number> {
    await this.#device.queue.onSubmittedWorkDone();
    return performance.now();
  }

  /** Takes note of how long somebody waited for work: no work takes less than none. */
  note(milliseconds: number): void {
    this.#latency = Math.min(this.#latency, milliseconds);
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
