import { NONE } from './page-list.js';

/** A page that has come, and those that have left for it. */
export interface Settled {
  readonly slots: readonly number[];
  readonly left: readonly { readonly page: number; readonly slots: readonly number[] }[];
}

/** Which pages are in which slots of a pool. */
export class PageSlots {
  /** [S] page in each slot, or {@link NONE}. */
  readonly pageIn: Uint32Array;
  /** [P] first slot of each page, or {@link NONE}. */
  readonly slotOf: Uint32Array;
  readonly #slotsOf = new Map<number, readonly number[]>();
  /** Empty slots, the next to be filled last. */
  readonly #empty: number[];

  constructor(pages: number, slots: number) {
    this.pageIn = new Uint32Array(slots).fill(NONE);
    this.slotOf = new Uint32Array(pages).fill(NONE);
    this.#empty = Array.from({ length: slots }, (_, k) => slots - 1 - k);
  }

  /** Slots without a page. */
  get empty(): number {
    return this.#empty.length;
  }

  /** Number of pages that have slots. */
  get count(): number {
    return this.#slotsOf.size;
  }

  /** The pages that have slots. */
  pages(): Iterable<number> {
    return this.#slotsOf.keys();
  }

  /** Slots of a page, in the order of its chunks; none of one that has none. */
  of(page: number): readonly number[] {
    return this.#slotsOf.get(page) ?? [];
  }

  /** Gives a page so many of the empty slots. @returns them */
  fill(page: number, count: number): readonly number[] {
    const slots: number[] = [];
    for (let k = 0; k < count; k++) {
      const slot = this.#empty.pop()!;
      slots.push(slot);
      this.pageIn[slot] = page;
    }
    this.#slotsOf.set(page, slots);
    this.slotOf[page] = slots[0];
    return slots;
  }

  /** Takes a page out of its slots. @returns them */
  clear(page: number): readonly number[] {
    const slots = this.of(page);
    for (let k = slots.length - 1; k >= 0; k--) {
      this.pageIn[slots[k]] = NONE;
      this.#empty.push(slots[k]);
    }
    this.#slotsOf.delete(page);
    this.slotOf[page] = NONE;
    return slots;
  }
}
