import { NONE } from './page-list.js';

/** Pages in the order of a number each, the largest first: a binary heap that is filled anew at every look, in time linear in the pages. */
export class PageHeap {
  readonly #pages: Uint32Array;
  readonly #ranks: Float32Array;
  #count = 0;

  /** @param capacity most pages that are in it at once */
  constructor(capacity: number) {
    this.#pages = new Uint32Array(capacity);
    this.#ranks = new Float32Array(capacity);
  }

  /** The largest number; -Infinity if there is none. */
  get largest(): number {
    return this.#count === 0 ? -Infinity : this.#ranks[0];
  }

  clear(): void {
    this.#count = 0;
  }

  /** Adds a page without order; {@link order} must follow before {@link pop}. */
  add(page: number, rank: number): void {
    this.#pages[this.#count] = page;
    this.#ranks[this.#count++] = rank;
  }

  /** Puts all that was added in order. */
  order(): void {
    for (let at = (this.#count >> 1) - 1; at >= 0; at--) this.#sink(at);
  }

  push(page: number, rank: number): void {
    let at = this.#count;
    this.add(page, rank);
    for (let above = (at - 1) >> 1; at > 0 && this.#ranks[above] < rank; above = (at - 1) >> 1) {
      this.#swap(at, above);
      at = above;
    }
  }

  /** Takes the page of the largest number out; {@link NONE} if there is none. */
  pop(): number {
    if (this.#count === 0) return NONE;
    const page = this.#pages[0];
    this.#swap(0, --this.#count);
    this.#sink(0);
    return page;
  }

  #sink(start: number): void {
    for (let at = start; ;) {
      let largest = at;
      for (let below = 2 * at + 1; below <= 2 * at + 2 && below < this.#count; below++) {
        if (this.#ranks[below] > this.#ranks[largest]) largest = below;
      }
      if (largest === at) return;
      this.#swap(at, largest);
      at = largest;
    }
  }

  #swap(a: number, b: number): void {
    const [pages, ranks] = [this.#pages, this.#ranks];
    const [page, rank] = [pages[a], ranks[a]];
    pages[a] = pages[b];
    ranks[a] = ranks[b];
    pages[b] = page;
    ranks[b] = rank;
  }
}
