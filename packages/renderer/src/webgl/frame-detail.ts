/** Factor of an interval above which a frame is late. */
const LATE = 1.5;
/** Interval in milliseconds above which the page was hidden or idle. */
const PAUSE_MS = 250;
/** Factors of the error after a late frame, and after one that {@link CALM} frames in time precede. */
const [RISE, FALL] = [1.1, 1 / 1.01];
/** Frames in time before the error falls, so that about one frame in seventy is late if the GPU is too slow. */
const CALM = 60;
/** Frames without motion before the error is the wanted one. */
const REST = 10;
/** Maximum factor of the error. */
const MAX_RISE = 4;

/**
 * Returns the fraction of width and height to render with an error of this factor: in steps, so that images do not shimmer
 * while the factor changes.
 */
export const resolutionFor = (factor: number): number => (factor > 2.8 ? 0.5 : factor > 1.4 ? Math.SQRT1_2 : 1);

/**
 * Raises the error of levels of detail while frames are late, because WebGL has no times of the GPU. Only a moving camera
 * raises it, so that a view at rest becomes as fine as asked.
 */
export class FrameDetail {
  #factor = 1;
  /** Frames since the last late one. */
  #calm = 0;
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
    const isLate = isMoving && interval > LATE * frameMs;
    this.#calm = isLate ? 0 : this.#calm + 1;
    if (isLate) this.#factor = Math.min(MAX_RISE, this.#factor * RISE);
    else if (!isMoving && this.#calm > REST) this.#factor = 1;
    else if (this.#calm > CALM) this.#factor = Math.max(1, this.#factor * FALL);
    return this.#factor;
  }
}
