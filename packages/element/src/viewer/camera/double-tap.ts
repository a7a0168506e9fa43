import type { Point } from './gestures.js';

/** Maximum duration of a tap, and maximum interval between two taps, milliseconds, as in touch browsers. */
const TAP_MS = 300;
/** Maximum movement of a tap, CSS pixels. */
const TAP_SLOP = 10;
/** Maximum distance between the two taps, CSS pixels. */
const SAME_PLACE = 32;

interface Tap extends Point {
  readonly ms: number;
}

/**
 * Detects double taps. Browsers differ in when two taps fire `dblclick`, depending on zooming and scrolling. Callers
 * pass the times in milliseconds.
 */
export class DoubleTap {
  #down: Tap | undefined;
  #first: Tap | undefined;

  /**
   * Handles a finger that touches the surface.
   * @param isAlone False while other fingers touch it, because two fingers do not tap.
   */
  down(point: Point, ms: number, isAlone: boolean): void {
    if (!isAlone) return this.cancel();
    this.#down = { ...point, ms };
    const isLate = this.#first !== undefined && ms - this.#first.ms > TAP_MS;
    if (isLate) this.#first = undefined;
  }

  /** Handles a finger that leaves the surface. @returns Whether that ends the second tap near the first one. */
  up(point: Point, ms: number): boolean {
    const [down, first] = [this.#down, this.#first];
    this.cancel();
    if (down === undefined || ms - down.ms > TAP_MS || distance(down, point) > TAP_SLOP) return false;
    if (first !== undefined && distance(first, point) <= SAME_PLACE) return true;
    this.#first = { ...point, ms };
    return false;
  }

  /** Discards the taps, because the page scrolls or two fingers touch the surface. */
  cancel(): void {
    this.#down = undefined;
    this.#first = undefined;
  }
}

const distance = (a: Point, b: Point): number => Math.hypot(a.x - b.x, a.y - b.y);
