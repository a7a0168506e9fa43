import { SpanTimer, type FrameTimer } from '@gaussian-splat/renderer';

/** So many frames in a row whose timestamps cannot be believed are enough. */
const MAX_FAILURES = 8;
/** When what was submitted was last known to be done, by whichever element: the page's one queue does one thing after the other. */
let lastDone = -Infinity;

/**
 * How long frames keep the GPU: by its own clock where the device has the feature `timestamp-query`, else by when their work is done. Nothing waits;
 * figures come a few frames later.
 */
export class FrameMeter {
  readonly #queue: GPUQueue;
  /** Others that work on the same queue between frames (a generator, a post-processor) would be counted with them. */
  readonly #mayGuess: () => boolean;
  #timer: SpanTimer | undefined;
  #failures = 0;

  /** @param mayGuess false where the time until work is done says nothing about the frame */
  constructor(device: GPUDevice, mayGuess: () => boolean) {
    this.#queue = device.queue;
    this.#mayGuess = mayGuess;
    if (device.features.has('timestamp-query')) this.#timer = new SpanTimer(device);
  }

  /** False where frames cannot be timed at all. */
  get isAble(): boolean {
    return this.#timer !== undefined || this.#mayGuess();
  }

  /**
   * Times a frame.
   * @param draw submits it; gets what its passes are timed with, if anything is
   * @param onTime gets milliseconds on the GPU
   */
  measure(draw: (timer: FrameTimer | undefined) => void, onTime: (milliseconds: number) => void): void {
    const timer = this.#timer;
    if (timer) {
      const isTimed = timer.expect((span) => this.#accept(span, onTime));
      draw(isTimed ? timer : undefined);
      return;
    }
    const submitted = performance.now();
    draw(undefined);
    if (this.#mayGuess()) void this.#waitAside(submitted, onTime);
  }

  destroy(): void {
    this.#timer?.destroy();
    this.#timer = undefined;
  }

  #accept(span: number | null, onTime: (milliseconds: number) => void): void {
    this.#failures = span === null ? this.#failures + 1 : 0;
    if (span !== null) onTime(span);
    if (this.#failures >= MAX_FAILURES) this.destroy();
  }

  /** From when the frame could begin, after its submission and the frame before, until it is done. */
  async #waitAside(submitted: number, onTime: (milliseconds: number) => void): Promise<void> {
    try {
      await this.#queue.onSubmittedWorkDone();
    } catch {
      // A lost device has been noticed elsewhere.
      return;
    }
    const done = performance.now();
    const began = Math.max(submitted, lastDone);
    lastDone = done;
    onTime(done - began);
  }
}
