import { PassTimer } from '../gpu/pass-timer.js';

/** Empty submissions of which the fastest tells how long a GPU with nothing to do takes to say so. */
const TRIES = 4;

/**
 * Times single frames: by the GPU's own clock where the device has the feature `timestamp-query`, else by waiting, less what waiting for
 * nothing takes. Browsers take milliseconds to say that a GPU is done, more than many a frame does.
 */
export class FrameClock {
  readonly #device: GPUDevice;
  readonly #timer: PassTimer | undefined;
  readonly #latency: number;

  static async on(device: GPUDevice): Promise<FrameClock> {
    if (device.features.has('timestamp-query')) return new FrameClock(device, new PassTimer(device), 0);
    let latency = Infinity;
    for (let i = 0; i < TRIES; i++) {
      const begin = performance.now();
      device.queue.submit([device.createCommandEncoder({ label: 'gs.probe' }).finish()]);
      await device.queue.onSubmittedWorkDone();
      latency = Math.min(latency, performance.now() - begin);
    }
    return new FrameClock(device, undefined, latency);
  }

  private constructor(device: GPUDevice, timer: PassTimer | undefined, latency: number) {
    this.#device = device;
    this.#timer = timer;
    this.#latency = latency;
  }

  /** Milliseconds of a frame that `draw` submits. */
  async time(draw: (timer: PassTimer | undefined) => void): Promise<number> {
    const begin = performance.now();
    draw(this.#timer);
    await this.#device.queue.onSubmittedWorkDone();
    const waited = performance.now() - begin - this.#latency;
    const passes = (await this.#timer?.read())?.at(-1) ?? [];
    const span = Math.max(...passes.map(({ end }) => end)) - Math.min(...passes.map((pass) => pass.begin));
    // Some drivers hand out timestamps that stand still or run backwards.
    return span > 0 ? span : waited;
  }

  destroy(): void {
    this.#timer?.destroy();
  }
}
