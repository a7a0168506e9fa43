import { perDevice } from './gpu/kernel.js';
import { QueueClock } from './gpu/queue-clock.js';

/**
 * Target duration of one submission, ms. Drivers reset the device after long ones (two seconds on Windows); the margin
 * is for views whose pairs cost more than those of the last measurement.
 */
const BUDGET_MS = 60;
/** Assumed milliseconds for a pair of splat and bin on an unmeasured device: a slow one. */
const UNKNOWN_COST = 0.5e-3;
/** Below this many pairs, the frame time says little about the cost of a pair. */
const TELLING_PAIRS = 1 << 16;
/**
 * Minimum weight of the previous cost, so that one measurement of an easy view, or one unrelated delay, does not
 * decide.
 */
const MEMORY = 0.5;
/** Maximum number of submissions, because each has its own cost. */
const MAX_SUBMITTED = 256;

/** Cost of rasterization on one device, shared by all renderers. */
class DeviceCost {
  /** Milliseconds for a pair of splat and bin, at the slowest place of the image. */
  perPair = UNKNOWN_COST;
}

/**
 * Determines the number of submissions of a frame so that none occupies the GPU for long. The work of a frame is
 * bounded by the capacity in pairs of splat and bin, even if the camera jumps. The cost of a pair is measured in frames
 * whose counts are read back anyway.
 */
export class SubmissionPacer {
  readonly #clock: QueueClock;
  readonly #cost: DeviceCost;

  constructor(device: GPUDevice) {
    this.#clock = QueueClock.of(device);
    this.#cost = perDevice(device, 'submission cost', () => new DeviceCost());
  }

  /** Number of submissions for a frame with at most this many pairs of splat and bin: 1 to 256, and 1 for fast frames. */
  partsFor(pairs: number): number {
    return Math.min(MAX_SUBMITTED, Math.max(1, Math.ceil((pairs * this.#cost.perPair) / BUDGET_MS)));
  }

  /** Maximum number of pairs for a single submission. */
  get pairsAtOnce(): number {
    return Math.floor(BUDGET_MS / this.#cost.perPair);
  }

  /** Whether a frame with this capacity can measure the cost of a pair. */
  wantsToKnow(pairs: number): boolean {
    return pairs * UNKNOWN_COST > BUDGET_MS;
  }

  /** Times the submissions of one frame; call it before the first of them. */
  watch(): SubmissionWatch {
    return new SubmissionWatch(this.#clock);
  }

  /** Updates the cost from the pair count of a watched frame. */
  async learn(watch: SubmissionWatch, pairs: Promise<number | undefined>): Promise<void> {
    const [times, painted] = [await watch.painting(), await pairs];
    if (times.length === 0 || painted === undefined || painted < TELLING_PAIRS) return;
    const found = (Math.max(...times) * times.length) / painted;
    this.#cost.perPair = Math.max(found, MEMORY * this.#cost.perPair);
  }
}

/** Completion times of the submissions of one frame, measured asynchronously. */
export class SubmissionWatch {
  readonly #clock: QueueClock;
  readonly #submitted: number[] = [];
  readonly #done: Promise<number>[] = [];

  constructor(clock: QueueClock) {
    this.#clock = clock;
    // Work submitted before this frame.
    this.note();
  }

  /** Call it after each submission. */
  note(): void {
    this.#submitted.push(performance.now());
    this.#done.push(this.#clock.done().then(({ now }) => now));
  }

  /**
   * Milliseconds of each submission that rasterizes: all but the first, or the only one including the earlier stages.
   * Empty if the device was lost meanwhile.
   */
  async painting(): Promise<number[]> {
    const done = await Promise.all(this.#done).catch(() => []);
    const times = done.slice(1).map((now, i) => this.#clock.spent(done[i], this.#submitted[i + 1], now));
    return times.length > 1 ? times.slice(1) : times;
  }
}
