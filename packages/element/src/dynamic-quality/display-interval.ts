/**
 * Assumed for unknown displays, and the longest accepted interval: frames that take too long look like a slow display.
 */
const USUAL_MS = 1000 / 60;
/** No display is faster. */
const MIN_MS = 1;
const MEMORY = 32;
const ENOUGH = 8;
/** Low enough to ignore a few late frames, high enough to ignore one early frame. */
const SHARE = 0.2;

/** The smallest value that at least this fraction of the values does not exceed. */
export function quantile(values: readonly number[], share: number): number {
  const sorted = [...values].sort((a, b) => a - b);
  return sorted[Math.min(sorted.length - 1, Math.max(0, Math.ceil(share * sorted.length) - 1))];
}

/** Refresh interval of the display, measured by the timestamps of requestAnimationFrame. */
export class DisplayInterval {
  #steps: number[] = [];
  #last: number | undefined;
  #milliseconds = USUAL_MS;

  /** Milliseconds; the interval of 60 Hz until enough frames were seen, and never more. */
  get milliseconds(): number {
    return this.#milliseconds;
  }

  /** A frame. @param now requestAnimationFrame's clock, ms */
  tick(now: number): void {
    const step = this.#last === undefined ? NaN : now - this.#last;
    this.#last = now;
    // Several elements draw at one moment.
    if (!(step >= MIN_MS)) return;
    this.#steps = [...this.#steps, step].slice(-MEMORY);
    if (this.#steps.length >= ENOUGH) this.#milliseconds = Math.min(USUAL_MS, quantile(this.#steps, SHARE));
  }

  /** No further frame follows the last one. */
  pause(): void {
    this.#last = undefined;
  }
}
