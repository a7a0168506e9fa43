import { perDevice } from './gpu/kernel.js';
import { QueueClock } from './gpu/queue-clock.js';

/**
 * Target duration of one submission in milliseconds. Drivers reset the device after long ones (two seconds on Windows).
 * The margin is for views whose pairs cost more than those of the last measurement.
 */
const BUDGET_MS = 60;
/** Assumed milliseconds for a pair of splat and bin on a device without a measurement: those of a slow device. */
const UNKNOWN_COST = 0.5e-3;
/**
 * Minimum number of pairs of a frame that determines their cost. The time of a frame with fewer pairs depends little on
 * them.
 */
const TELLING_PAIRS = 1 << 16;
/** Minimum factor of the previous cost in an update. One measurement of an easy view therefore has a limited effect. */
const MEMORY = 0.5;
/** Maximum number of submissions, because each has its own cost. */
const MAX_SUBMITTED = 256;

/** Cost of rasterization on one device, shared by all its renderers. */
class DeviceCost {
  /** Milliseconds for a pair of splat and bin, at the slowest place of the image. */
  perPair = UNKNOWN_COST;
}

/**
 * Determines the number of submissions of a frame, so that no submission occupies the GPU for long. The capacity in
 * pairs of splat and bin bounds the work of a frame, even if the camera jumps. The cost of a pair is measured in frames
 * whose counts are read back for other reasons.
 */
export class SubmissionPacer {
  readonly #clock: QueueClock;
  readonly #cost: DeviceCost;

  constructor(device: GPUDevice) {
    this.#clock = QueueClock.of(device);
    this.#cost = perDevice(device, 'submission cost', () => new DeviceCost());
  }

  /**
   * Returns the number of submissions for a frame with at most this many pairs of splat and bin: 1 to 256, and 1 for
   * fast frames.
   */
  partsFor(pairs: number): number {
    return Math.min(MAX_SUBMITTED, Math.max(1, Math.ceil((pairs * this.#cost.perPair) / BUDGET_MS)));
  }

  /** Maximum number of pairs of splat and bin in a single submission. */
  get pairsAtOnce(): number {
    return Math.floor(BUDGET_MS / this.#cost.perPair);
  }

  /** Whether a frame with this capacity in pairs is expensive enough on a slow device to measure the cost of a pair. */
  wantsToKnow(pairs: number): boolean {
    return pairs * UNKNOWN_COST > BUDGET_MS;
  }

  /** Starts to time the submissions of one frame: call it before the first of them. */
  watch(): SubmissionWatch {
    return new SubmissionWatch(this.#clock);
  }

  /**
   * Updates the cost of a pair from the times of a frame and its number of pairs. Does nothing for undefined or few
   * pairs, or if the device was lost.
   */
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
    // Marks the end of the work that was submitted before this frame.
    this.note();
  }

  /** Records the time of a submission: call it after each submission of the frame. */
  note(): void {
    this.#submitted.push(performance.now());
    this.#done.push(this.#clock.done().then(({ now }) => now));
  }

  /**
   * Resolves to the milliseconds of each submission that rasterizes. The first submission, which contains the earlier
   * stages, is omitted unless it is the only one. Empty if the device was lost meanwhile.
   */
  async painting(): Promise<number[]> {
    const done = await Promise.all(this.#done).catch(() => []);
    const times = done.slice(1).map((now, i) => this.#clock.spent(done[i], this.#submitted[i + 1], now));
    return times.length > 1 ? times.slice(1) : times;
  }
}
