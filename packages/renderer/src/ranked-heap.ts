/** Marks the absence of an item. */
export const NONE = 0xffffffff;

/** Numbered items with ranks, largest rank first: a binary heap (Williams 1964) that is built in linear time. */
export class RankedHeap {
  readonly #items: Uint32Array;
  readonly #ranks: Float64Array;
  #count = 0;

  /** @param capacity Maximum number of items. */
  constructor(capacity: number) {
    this.#items = new Uint32Array(capacity);
    this.#ranks = new Float64Array(capacity);
  }

  /** Items in the order of the binary heap, without the removed ones. A view of the internal array. */
  get items(): Uint32Array {
    return this.#items.subarray(0, this.#count);
  }

  get size(): number {
    return this.#count;
  }

  /** The largest rank; -Infinity if the heap is empty. */
  get largest(): number {
    return this.#count === 0 ? -Infinity : this.#ranks[0];
  }

  clear(): void {
    this.#count = 0;
  }

  /** Appends an item without ordering the heap: call {@link order} before {@link pop}. */
  add(item: number, rank: number): void {
    this.#items[this.#count] = item;
    this.#ranks[this.#count++] = rank;
  }

  /** Orders all appended items, in linear time. */
  order(): void {
    for (let at = (this.#count >> 1) - 1; at >= 0; at--) this.#sink(at);
  }

  /** Inserts an item into an ordered heap. */
  push(item: number, rank: number): void {
    let at = this.#count;
    this.add(item, rank);
    for (let above = (at - 1) >> 1; at > 0 && this.#ranks[above] < rank; above = (at - 1) >> 1) {
      this.#swap(at, above);
      at = above;
    }
  }

  /** Removes and returns the item of the largest rank; {@link NONE} if the heap is empty. */
  pop(): number {
    if (this.#count === 0) return NONE;
    const item = this.#items[0];
    this.#swap(0, --this.#count);
    this.#sink(0);
    return item;
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
    const [items, ranks] = [this.#items, this.#ranks];
    const [item, rank] = [items[a], ranks[a]];
    items[a] = items[b];
    ranks[a] = ranks[b];
    items[b] = item;
    ranks[b] = rank;
  }
}
