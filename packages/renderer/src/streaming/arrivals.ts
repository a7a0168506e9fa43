import { ARRIVED } from './page-rows.js';
import { NONE, type PageList } from './page-list.js';

export const ARRIVAL_MS = 400;
/** Frames that a page takes to arrive at least, however slow they are. */
export const LEAST_STEPS = 16;

/** Pages that take the place of what stood for them, little by little; none before the page above it. */
export class Arrivals {
  readonly #list: PageList;
  readonly #milliseconds: number;
  readonly #setArrived: (page: number, arrived: number) => void;
  /** [P] how much of the time of a page has passed, 0 to 1; 1 for those that are not {@link #arriving}. */
  readonly #passed: Float32Array;
  /** Parents before children. */
  readonly #arriving = new Set<number>();
  #steppedAt = 0;

  /**
   * @param milliseconds that it takes, in {@link LEAST_STEPS} frames at least; 0 for at once
   * @param setArrived gets a page, and how far it has arrived: 0 to `ARRIVED`
   */
  constructor(list: PageList, milliseconds: number, setArrived: (page: number, arrived: number) => void) {
    this.#list = list;
    this.#milliseconds = milliseconds;
    this.#setArrived = setArrived;
    this.#passed = new Float32Array(list.count).fill(1);
  }

  /** Pages that have not arrived whole. */
  get count(): number {
    return this.#arriving.size;
  }

  /** A page is there from now on. One that nothing is above of has arrived. */
  begin(page: number): void {
    const isAtOnce = this.#list.parent[page] === NONE || this.#milliseconds === 0;
    if (!isAtOnce) {
      this.#arriving.add(page);
      this.#passed[page] = 0;
    }
    this.#setArrived(page, isAtOnce ? ARRIVED : 0);
  }

  /** A page has left. */
  forget(page: number): void {
    this.#arriving.delete(page);
    this.#passed[page] = 1;
  }

  /** Lets all go another step: thousands in each frame of a flight. @returns false if there were none */
  step(now: number): boolean {
    const elapsed = (now - this.#steppedAt) / this.#milliseconds;
    this.#steppedAt = now;
    if (this.#arriving.size === 0) return false;
    const step = Math.min(1 / LEAST_STEPS, elapsed);
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

/** Slow at both ends: an opaque splat in the share w has the opacity 1 − (1 − a)^w, which is a third at the first of sixteen even steps. */
const eased = (t: number): number => t * t * (3 - 2 * t);
