/** Minimum (and initial) and maximum fraction of the frame interval for uploads on the main thread. */
export const UPLOAD_SHARE = { min: 1 / 8, max: 1 / 4 } as const;
/** Increase of the fraction after a frame that used its budget and was in time. */
const GROWTH = 1 / 512;
/** Minimum and maximum of the upload time in a frame, in milliseconds. */
const [MIN_MS, MAX_MS] = [1, 5];
/**
 * Maximum number of bytes in one frame. It is independent of their main-thread time, because the cost in the GPU
 * process and on the GPU is not measured. With this limit few frames were late; with 20 MB, intervals of up to 110 ms
 * occurred (docs/lod-format.md).
 */
export const MAX_UPLOAD_BYTES = 14e6;
/** Initial estimate of the upload rate: milliseconds and bytes of 650 MB/s. */
const [FIRST_MS, FIRST_BYTES] = [2, 1.3e6];
/** Weight of the previous average at each upload. It averages out clocks with a resolution of one millisecond. */
const MEMORY = 0.9;
/** Factor of the usual frame interval above which a frame is late. */
const LATE = 1.75;
/** Interval in milliseconds above which the page was hidden or idle: such a frame is ignored. */
const PAUSE_MS = 250;
/**
 * Rates at which the usual interval adapts to shorter and to longer intervals. It converges to an interval that one
 * frame in nine undercuts, so that a page that draws only every other frame counts as late.
 */
const [FALLS, RISES] = [1 / 8, 1 / 64];
/** Fraction of the byte budget above which a frame counts as having used it. */
const FULL = 0.75;

/**
 * Limits the bytes that a frame uploads to a fraction of the frame interval, converted by the measured upload rate, and
 * to {@link MAX_UPLOAD_BYTES}. The fraction grows slowly while frames that use it are in time. A late frame halves the
 * fraction (additive increase, multiplicative decrease: Chiu and Jain, 1989).
 */
export class UploadBudget {
  #milliseconds = FIRST_MS;
  #bytes = FIRST_BYTES;
  #frameAt = -Infinity;
  #share: number = UPLOAD_SHARE.min;
  /** Usual milliseconds between frames; 0 before the second frame. */
  #usual = 0;
  /** Byte budget of the current frame. */
  #allowed = 0;
  /** Bytes that the current frame has uploaded. */
  #used = 0;

  /** Fraction of the frame interval for uploads in the next frame. */
  get share(): number {
    return this.#share;
  }

  /**
   * Starts a frame.
   * @param now Current time in milliseconds.
   * @returns Number of bytes that this frame may upload.
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

  /** Records the bytes and the milliseconds of an upload. */
  note(bytes: number, milliseconds: number): void {
    this.#used += bytes;
    this.#bytes = MEMORY * this.#bytes + bytes;
    this.#milliseconds = MEMORY * this.#milliseconds + milliseconds;
  }

  #adapt(interval: number): void {
    if (interval > PAUSE_MS) return;
    if (this.#usual === 0) this.#usual = interval;
    if (interval > LATE * this.#usual) {
      // A late frame had no time to spare, for any cause of the delay.
      if (this.#used > 0) this.#share = Math.max(UPLOAD_SHARE.min, this.#share / 2);
    } else if (this.#used >= FULL * this.#allowed) {
      this.#share = Math.min(UPLOAD_SHARE.max, this.#share + GROWTH);
    }
    this.#usual += (interval < this.#usual ? FALLS : RISES) * (interval - this.#usual);
  }
}
