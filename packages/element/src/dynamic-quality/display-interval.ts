/**
 * Interval that is assumed for unknown displays, ms. It is also the maximum, because frames that take too long look
 * like those of a slow display.
 */
const USUAL_MS = 1000 / 60;
/** Minimum interval, ms; no display is faster. */
const MIN_MS = 1;
const MEMORY = 32;
const ENOUGH = 8;
/**
 * Quantile of the intervals that counts: low enough to ignore many late frames, and high enough to ignore one early
 * frame.
 */
const SHARE = 0.2;

/**
 * Returns the quantile of some values: the smallest value that is not exceeded by the fraction `share`, 0..1, of them.
 */
export function quantile(values: readonly number[], share: number): number {
  const sorted = [...values].sort((a, b) => a - b);
  return sorted[Math.min(sorted.length - 1, Math.max(0, Math.ceil(share * sorted.length) - 1))];
}

/** Measures the refresh interval of the display from the timestamps of requestAnimationFrame. */
export class DisplayInterval {
  #steps: number[] = [];
  #last: number | undefined;
  #milliseconds = USUAL_MS;

  /** Refresh interval, ms; that of 60 Hz until enough frames were measured, and never longer. */
  get milliseconds(): number {
    return this.#milliseconds;
  }

  /** Call in each frame. @param now requestAnimationFrame's clock, ms. */
  tick(now: number): void {
    const step = this.#last === undefined ? NaN : now - this.#last;
    this.#last = now;
    // Two ticks at the same time are no interval.
    if (!(step >= MIN_MS)) return;
    this.#steps = [...this.#steps, step].slice(-MEMORY);
    if (this.#steps.length >= ENOUGH) this.#milliseconds = Math.min(USUAL_MS, quantile(this.#steps, SHARE));
  }

  /** Call if no frame follows, so that the pause is not measured as an interval. */
  pause(): void {
    this.#last = undefined;
  }
}
