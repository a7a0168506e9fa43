import type { Point } from './gestures.js';

/** Longest that a finger rests for a tap, and longest from one tap to the next, ms: as touch browsers have it. */
const TAP_MS = 300;
/** A finger that has moved further is no tap, CSS pixels. */
const TAP_SLOP = 10;
/** Furthest from the first tap to the second, CSS pixels: fingers are wide. */
const SAME_PLACE = 32;

interface Tap extends Point {
  readonly ms: number;
}

/**
 * Tells double taps from all else that fingers do. Whether two taps are a `dblclick`, too, browsers decide each their own way, by what they zoom
 * and scroll. Pure: times are handed in.
 */
export class DoubleTap {
  #down: Tap | undefined;
  #first: Tap | undefined;

  /** A finger comes down. @param isAlone false while others are down: two fingers do not tap */
  down(point: Point, ms: number, isAlone: boolean): void {
    if (!isAlone) return this.cancel();
    this.#down = { ...point, ms };
    const isLate = this.#first !== undefined && ms - this.#first.ms > TAP_MS;
    if (isLate) this.#first = undefined;
  }

  /** It goes up; true for the end of a second tap where the first one was. */
  up(point: Point, ms: number): boolean {
    const [down, first] = [this.#down, this.#first];
    this.cancel();
    if (down === undefined || ms - down.ms > TAP_MS || distance(down, point) > TAP_SLOP) return false;
    if (first !== undefined && distance(first, point) <= SAME_PLACE) return true;
    this.#first = { ...point, ms };
    return false;
  }

  /** What fingers do is something else: the page scrolls, or there are two. */
  cancel(): void {
    this.#down = undefined;
    this.#first = undefined;
  }
}

const distance = (a: Point, b: Point): number => Math.hypot(a.x - b.x, a.y - b.y);
