/** Factor of an interval above which a frame is late. */
const LATE = 1.5;
/** Interval in milliseconds above which the page was hidden or idle. */
const PAUSE_MS = 250;
/** Factors of the error after a late frame and after one in time: an error that is kept has one late frame in a hundred. */
const [RISE, FALL] = [1.1, 1 / 1.001];
/** Maximum factor of the error. */
const MAX_RISE = 4;

/**
 * Raises the error of levels of detail while frames are late, because WebGL has no times of the GPU. Only a moving camera
 * raises it, so that a view at rest becomes as fine as asked.
 */
export class FrameDetail {
  #factor = 1;
  #at = -Infinity;

  /**
   * Starts a frame.
   * @param now Current time in milliseconds.
   * @param frameMs Interval of frames to keep, milliseconds.
   * @returns Factor of the error for this frame, 1 to 4.
   */
  next(now: number, frameMs: number, isMoving: boolean): number {
    const interval = now - this.#at;
    this.#at = now;
    if (interval > PAUSE_MS) return this.#factor;
    if (interval <= LATE * frameMs || !isMoving) this.#factor = Math.max(1, this.#factor * FALL);
    else this.#factor = Math.min(MAX_RISE, this.#factor * RISE);
    return this.#factor;
  }
}
