/** Fraction of the frame interval for uploads on the main thread: initial value and minimum, and maximum. */
export const UPLOAD_SHARE = { min: 1 / 8, max: 1 / 4 } as const;
/** Increase of the fraction after a frame that used its budget and was followed in time by the next. */
const GROWTH = 1 / 512;
/** Bounds in milliseconds. */
const [MIN_MS, MAX_MS] = [1, 5];
/**
 * Maximum bytes in one frame, independent of their main-thread time, because the cost in the GPU process and on the GPU
 * is not measured. With this limit few frames were late; with 20 MB intervals of up to 110 ms occurred
 * (docs/lod-format.md).
 */
export const MAX_UPLOAD_BYTES = 14e6;
/** Initial estimate of the upload time, before any measurement: 650 MB a second. */
const [FIRST_MS, FIRST_BYTES] = [2, 1.3e6];
/**
 * Weight of the previous average at each upload, so that clocks with a resolution of a millisecond are right on
 * average.
 */
const MEMORY = 0.9;
/**
 * A frame is late if its interval exceeds the usual one by this factor; intervals above PAUSE_MS mean that the page was
 * hidden or idle.
 */
const LATE = 1.75;
const PAUSE_MS = 250;
/**
 * Rates of adaptation of the usual interval to shorter and longer ones. It converges to an interval that one frame in
 * nine undercuts, because a page that draws every other frame is always late.
 */
const [FALLS, RISES] = [1 / 8, 1 / 64];
/** Fraction of the byte budget above which a frame counts as having used it. */
const FULL = 0.75;

/**
 * Limits the bytes that a frame uploads: a fraction of the frame interval, converted by the measured upload rate, and
 * never more than {@link MAX_UPLOAD_BYTES}. The fraction grows slowly while frames that use it are in time, and is
 * halved when one is late (additive increase, multiplicative decrease: Chiu and Jain, 1989).
 */
export class UploadBudget {
  #milliseconds = FIRST_MS;
  #bytes = FIRST_BYTES;
  #frameAt = -Infinity;
  #share: number = UPLOAD_SHARE.min;
  /** Milliseconds between frames; 0 before there are two. */
  #usual = 0;
  #allowed = 0;
  #used = 0;

  /** Fraction of the interval for the next frame. */
  get share(): number {
    return this.#share;
  }

  /**
   * Starts a frame.
   * @param now Milliseconds.
   * @returns Number of bytes that it may upload.
   */
  startFrame(now: number): number {
    const interval = now - this.#frameAt;
    this.#frameAt = now;
    this.#adapt(interval);
    const usual = this.#usual === 0 ? interval : Math.min(interval, this.#usual);
    const max = Math.min(MAX_MS, Math.max(MIN_MS, this.#share * usual));
    this.#allowed = Math.min(MAX_UPLOAD_BYTES, (max * this.#bytes) / Math.max(1e-3, this.#milliseconds));
    this.#used = 0;
    return this.#allowed;
  }

  /** Records the duration of an upload. */
  note(bytes: number, milliseconds: number): void {
    this.#used += bytes;
    this.#bytes = MEMORY * this.#bytes + bytes;
    this.#milliseconds = MEMORY * this.#milliseconds + milliseconds;
  }

  #adapt(interval: number): void {
    if (interval > PAUSE_MS) return;
    if (this.#usual === 0) this.#usual = interval;
    if (interval > LATE * this.#usual) {
      // For any cause of the delay, the frame had no time to spare.
      if (this.#used > 0) this.#share = Math.max(UPLOAD_SHARE.min, this.#share / 2);
    } else if (this.#used >= FULL * this.#allowed) {
      this.#share = Math.min(UPLOAD_SHARE.max, this.#share + GROWTH);
    }
    this.#usual += (interval < this.#usual ? FALLS : RISES) * (interval - this.#usual);
  }
}
