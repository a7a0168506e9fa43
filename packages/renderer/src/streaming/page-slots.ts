import { NONE } from './page-list.js';

/** Slots of a new page, and the pages that were evicted for it with their former slots. */
export interface Settled {
  readonly slots: readonly number[];
  readonly left: readonly { readonly page: number; readonly slots: readonly number[] }[];
}

/** Maps pages to the slots of a pool. A page may have several slots. */
export class PageSlots {
  /** [S] page in each slot, or {@link NONE}. */
  readonly pageIn: Uint32Array;
  /** [P] first slot of each page, or {@link NONE}. */
  readonly slotOf: Uint32Array;
  readonly #slotsOf = new Map<number, readonly number[]>();
  /** Indices of the empty slots; the last one is filled next. */
  readonly #empty: number[];

  constructor(pages: number, slots: number) {
    this.pageIn = new Uint32Array(slots).fill(NONE);
    this.slotOf = new Uint32Array(pages).fill(NONE);
    this.#empty = Array.from({ length: slots }, (_, k) => slots - 1 - k);
  }

  /** Number of slots without a page. */
  get empty(): number {
    return this.#empty.length;
  }

  /** Number of resident pages. */
  get count(): number {
    return this.#slotsOf.size;
  }

  /** Returns the indices of the resident pages. */
  pages(): Iterable<number> {
    return this.#slotsOf.keys();
  }

  /** Returns the slots of a page in the order of its chunks; empty if the page is not resident. */
  of(page: number): readonly number[] {
    return this.#slotsOf.get(page) ?? [];
  }

  /** Assigns `count` empty slots to a page; there must be enough of them. @returns The slots. */
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

  /** Removes a page from its slots. @returns The slots, now empty. */
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
