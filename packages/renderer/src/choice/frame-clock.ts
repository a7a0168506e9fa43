import { QueueClock } from '../gpu/queue-clock.js';

/** Times frames of which several are drawn in a row, the queue drained once. */
export class FrameClock {
  readonly #clock: QueueClock;

  static async on(device: GPUDevice): Promise<FrameClock> {
    const clock = QueueClock.of(device);
    await clock.calibrate();
    return new FrameClock(clock);
  }

  private constructor(clock: QueueClock) {
    this.#clock = clock;
  }

  /** Milliseconds of each of `count` frames that `draw` submits. */
  async time(count: number, draw: () => void): Promise<number> {
    const begin = performance.now();
    for (let frame = 0; frame < count; frame++) draw();
    const { now } = await this.#clock.done();
    return Math.max(0, now - begin - this.#clock.latency) / count;
  }
}
