import { ARRIVED } from './page-rows.js';
import { NONE, type PageList } from './page-list.js';

export const ARRIVAL_MS = 400;
/** Minimum number of frames over which a page fades in. */
export const MIN_STEPS = 16;

/** Fades in pages over their parents. The fade of a page is never ahead of that of its parent. */
export class PageFadeIn {
  readonly #list: PageList;
  readonly #milliseconds: number;
  readonly #setArrived: (page: number, arrived: number) => void;
  /** [P] elapsed fraction of the fade of each page, 0 to 1; 1 for pages that are not {@link #arriving}. */
  readonly #passed: Float32Array;
  /** Pages that are fading in, parents before children. */
  readonly #arriving = new Set<number>();
  #steppedAt = 0;

  /**
   * @param milliseconds Duration of a fade, which takes at least {@link MIN_STEPS} frames; 0 for no fade.
   * @param setArrived Called with a page and the progress of its fade, 0 to `ARRIVED`.
   */
  constructor(list: PageList, milliseconds: number, setArrived: (page: number, arrived: number) => void) {
    this.#list = list;
    this.#milliseconds = milliseconds;
    this.#setArrived = setArrived;
    this.#passed = new Float32Array(list.capacity ?? list.count).fill(1);
  }

  /** Number of pages that are still fading in. */
  get count(): number {
    return this.#arriving.size;
  }

  /** Starts the fade of a resident page. A page without a parent is drawn completely at once. */
  begin(page: number): void {
    const isAtOnce = this.#list.parent[page] === NONE || this.#milliseconds === 0;
    if (!isAtOnce) {
      this.#arriving.add(page);
      this.#passed[page] = 0;
    }
    this.#setArrived(page, isAtOnce ? ARRIVED : 0);
  }

  /** Ends the fade of a page that was evicted. */
  forget(page: number): void {
    this.#arriving.delete(page);
    this.#passed[page] = 1;
  }

  /**
   * Advances all fades; a frame of a flight may have thousands.
   * @param now Current time in milliseconds.
   * @returns Whether any page was fading in.
   */
  step(now: number): boolean {
    const elapsed = (now - this.#steppedAt) / this.#milliseconds;
    this.#steppedAt = now;
    if (this.#arriving.size === 0) return false;
    const step = Math.min(1 / MIN_STEPS, elapsed);
    const [passed, { parent }] = [this.#passed, this.#list];
    for (const page of this.#arriving) {
      const next = Math.min(passed[parent[page]], passed[page] + step);
      passed[page] = next;
      if (next === 1) this.#arriving.delete(page);
      this.#setArrived(page, Math.round(ARRIVED * eased(next)));
    }
    return true;
  }
}

/**
 * Eases the progress at both ends. An opaque splat of weight w has the opacity 1 − (1 − a)^w, which is already a third
 * after the first of sixteen linear steps.
 */
const eased = (t: number): number => t * t * (3 - 2 * t);
