/** Empty submissions of which the fastest tells how long a GPU with nothing to do takes to say so. */
const TRIES = 4;

/**
 * Times frames as a page waits for them: several in a row, the queue drained once, less what waiting for nothing takes. The time between a GPU's own timestamps
 * leaves out what the browser does between passes, which can be most of a frame.
 */
export class FrameClock {
  readonly #queue: GPUQueue;
  readonly #latency: number;

  static async on(device: GPUDevice): Promise<FrameClock> {
    let latency = Infinity;
    for (let i = 0; i < TRIES; i++) {
      const begin = performance.now();
      device.queue.submit([device.createCommandEncoder({ label: 'gs.probe' }).finish()]);
      await device.queue.onSubmittedWorkDone();
      latency = Math.min(latency, performance.now() - begin);
    }
    return new FrameClock(device.queue, latency);
  }

  private constructor(queue: GPUQueue, latency: number) {
    this.#queue = queue;
    this.#latency = latency;
  }

  /** Milliseconds of each of `count` frames that `draw` submits. */
  async time(count: number, draw: () => void): Promise<number> {
    const begin = performance.now();
    for (let frame = 0; frame < count; frame++) draw();
    await this.#queue.onSubmittedWorkDone();
    return Math.max(0, performance.now() - begin - this.#latency) / count;
  }
}
