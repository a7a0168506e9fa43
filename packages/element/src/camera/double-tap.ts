import type { Point } from './gestures.js';

/** Maximum duration of a tap, and maximum interval between two taps, ms: as in touch browsers. */
const TAP_MS = 300;
/** Maximum movement of a tap, CSS pixels. */
const TAP_SLOP = 10;
/** Maximum distance between the two taps, CSS pixels. */
const SAME_PLACE = 32;

interface Tap extends Point {
  readonly ms: number;
}

/**
 * Detects double taps. Browsers differ in when two taps fire `dblclick`, depending on zooming and scrolling, so taps
 * are detected here. Pure: times are passed in.
 */
export class DoubleTap {
  #down: Tap | undefined;
  #first: Tap | undefined;

  /** Handles a finger that goes down. @param isAlone False while others are down, because two fingers do not tap. */
  down(point: Point, ms: number, isAlone: boolean): void {
    if (!isAlone) return this.cancel();
    this.#down = { ...point, ms };
    const isLate = this.#first !== undefined && ms - this.#first.ms > TAP_MS;
    if (isLate) this.#first = undefined;
  }

  /** Handles a finger that goes up; returns true at the end of a second tap near the first one. */
  up(point: Point, ms: number): boolean {
    const [down, first] = [this.#down, this.#first];
    this.cancel();
    if (down === undefined || ms - down.ms > TAP_MS || distance(down, point) > TAP_SLOP) return false;
    if (first !== undefined && distance(first, point) <= SAME_PLACE) return true;
    this.#first = { ...point, ms };
    return false;
  }

  /** Discards the taps: the page scrolls, or there are two fingers. */
  cancel(): void {
    this.#down = undefined;
    this.#first = undefined;
  }
}

const distance = (a: Point, b: Point): number => Math.hypot(a.x - b.x, a.y - b.y);
