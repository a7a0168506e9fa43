import { perDevice } from './gpu/kernel.js';
import { QueueClock } from './gpu/queue-clock.js';

/**
 * Milliseconds that one submission is meant to keep the GPU. Drivers stop what runs for long (two seconds on Windows) and the device is lost with it:
 * the rest is room for views whose pairs cost more than those of the last look.
 */
const BUDGET_MS = 60;
/** Milliseconds that a pair of splat and bin is taken to cost on a device of which nothing is known yet: a slow one. */
const UNKNOWN_COST = 0.5e-3;
/** Pairs under which what a frame takes says little about what a pair costs. */
const TELLING_PAIRS = 1 << 16;
/** Share of the last cost that is believed at least: one look at an easy view, or one hold-up elsewhere, does not decide. */
const MEMORY = 0.5;
/** Submissions beyond which dividing is given up: each costs some time, too. */
const MOST = 256;

/** What painting costs on one device, whichever renderer paints. */
class DeviceCost {
  /** Milliseconds a pair of splat and bin, at the slowest place of the image. */
  perPair = UNKNOWN_COST;
}

/**
 * Finds into how many submissions the painting of a frame must be divided so that none keeps the GPU for long. The work of a frame is at most the pairs of splat and
 * bin that there is room for: a bound that holds however the camera jumps. What a pair costs is measured at the frames whose counts are read back anyway.
 */
export class SubmissionPacer {
  readonly #clock: QueueClock;
  readonly #cost: DeviceCost;

  constructor(device: GPUDevice) {
    this.#clock = QueueClock.of(device);
    this.#cost = perDevice(device, 'submission cost', () => new DeviceCost());
  }

  /** Submissions for a frame of at most so many pairs of splat and bin: 1 to 256, and 1 for all that is known to be quick. */
  partsFor(pairs: number): number {
    return Math.min(MOST, Math.max(1, Math.ceil((pairs * this.#cost.perPair) / BUDGET_MS)));
  }

  /** Pairs for which one submission is enough. */
  get pairsAtOnce(): number {
    return Math.floor(BUDGET_MS / this.#cost.perPair);
  }

  /** True if a frame with room for so many pairs may tell what one costs. */
  wantsToKnow(pairs: number): boolean {
    return pairs * UNKNOWN_COST > BUDGET_MS;
  }

  /** Times the submissions of one frame; call it before the first of them. */
  watch(): SubmissionWatch {
    return new SubmissionWatch(this.#clock);
  }

  /** Takes note of how many pairs a watched frame has painted. */
  async learn(watch: SubmissionWatch, pairs: Promise<number | undefined>): Promise<void> {
    const [times, painted] = [await watch.painting(), await pairs];
    if (times.length === 0 || painted === undefined || painted < TELLING_PAIRS) return;
    const found = (Math.max(...times) * times.length) / painted;
    this.#cost.perPair = Math.max(found, MEMORY * this.#cost.perPair);
  }
}

/** When the submissions of one frame were done. Nothing waits for it. */
export class SubmissionWatch {
  readonly #clock: QueueClock;
  readonly #submitted: number[] = [];
  readonly #done: Promise<number>[] = [];

  constructor(clock: QueueClock) {
    this.#clock = clock;
    // What was handed over before this frame.
    this.note();
  }

  /** Call it after each submission. */
  note(): void {
    this.#submitted.push(performance.now());
    this.#done.push(this.#clock.done().then(({ now }) => now));
  }

  /**
   * Milliseconds of each submission that paints: all but the first, or that one where it is the only one, with what comes before the painting. None where the device
   * was lost meanwhile.
   */
  async painting(): Promise<number[]> {
    const done = await Promise.all(this.#done).catch(() => []);
    const times = done.slice(1).map((now, i) => this.#clock.spent(done[i], this.#submitted[i + 1], now));
    return times.length > 1 ? times.slice(1) : times;
  }
}
