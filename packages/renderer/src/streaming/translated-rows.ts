import type { Vector3 } from '@gaussian-splat/core';
import { DetailTable } from './detail-table.js';
import { SLOT_CHUNKS, type PageFormat } from './manifest.js';
import { childrenIn, NONE, type PageList } from './page-list.js';
import { PageRows } from './page-rows.js';
import type { Residency } from './residency.js';
import { chunkLayout, numbersOf, type ChunkLayout, type SlotWords } from './slot-words.js';

/**
 * LOD rows of all slots, updated page by page. They determine the weight of each chunk as pages arrive and are evicted.
 */
export class TranslatedRows {
  readonly #list: PageList;
  readonly #residency: Residency;
  readonly #table: DetailTable;
  /** Rows by slot. */
  readonly #rows: readonly PageRows[];
  readonly #layout: ChunkLayout;

  constructor(list: PageList, residency: Residency, format: PageFormat) {
    this.#layout = chunkLayout(format);
    this.#list = list;
    this.#residency = residency;
    const slots = residency.slots.pageIn.length;
    this.#table = new DetailTable(slots);
    this.#rows = Array.from({ length: slots }, (_, slot) => new PageRows(this.#table.rowsOf(slot)));
  }

  /**
   * Sets the rows of a page. None of its children may be resident, and its fade-in must not have started.
   * @param parts Words of each slot of the page.
   * @param by Translation in world units, added to all positions.
   */
  load(page: number, parts: readonly SlotWords[], by: Vector3): void {
    const { upper, parent, parentChunk } = this.#list;
    const above =
      parent[page] === NONE
        ? undefined
        : this.#rowsOf(parent[page], parentChunk[page]).above(parentChunk[page] % SLOT_CHUNKS);
    const slots = this.#residency.slots.of(page);
    parts.forEach((words, k) => {
      const { chunks } = words;
      const rows = this.#rows[slots[k]];
      rows.load(numbersOf(words, 'details', this.#layout), by, childrenIn(this.#list, page, k).subarray(0, chunks));
      if (above) rows.setAbove(Math.min(chunks, Math.max(0, upper[page] - SLOT_CHUNKS * k)), above);
      this.#table.touch(slots[k]);
    });
  }

  /** Sets the fade-in of a page, 0 to `ARRIVED`. The page replaces its parent chunks by this fraction. */
  setArrived(page: number, arrived: number): void {
    if (this.#list.slots[page] === 1) this.#setSlot(this.#residency.slots.slotOf[page], arrived);
    else for (const slot of this.#residency.slots.of(page)) this.#setSlot(slot, arrived);
    this.#setBelow(page, arrived);
  }

  /** Clears the slots of an evicted page; its parent chunks are drawn again. */
  leave(page: number, slots: readonly number[]): void {
    for (const slot of slots) {
      this.#rows[slot].clear();
      this.#table.touch(slot);
    }
    this.#setBelow(page, 0);
  }

  /** Writes the changed rows: see {@link DetailTable.flush}. */
  flush(slotsPerBuffer: number, write: (slot: number, rows: Float32Array<ArrayBuffer>) => void): void {
    this.#table.flush(slotsPerBuffer, write);
  }

  #rowsOf(page: number, chunk: number): PageRows {
    return this.#rows[this.#residency.slots.of(page)[Math.floor(chunk / SLOT_CHUNKS)]];
  }

  #setSlot(slot: number, arrived: number): void {
    this.#rows[slot].setArrived(arrived);
    this.#table.touch(slot);
  }

  #setBelow(page: number, arrived: number): void {
    const parent = this.#list.parent[page];
    if (parent === NONE) return;
    const first = this.#list.parentChunk[page];
    if (this.#list.slots[parent] === 1 && this.#list.parentChunks[page] === 1) {
      const slot = this.#residency.slots.slotOf[parent];
      this.#rows[slot].setBelow(first, arrived);
      this.#table.touch(slot);
      return;
    }
    const slots = this.#residency.slots.of(parent);
    const end = first + this.#list.parentChunks[page];
    for (let chunk = first; chunk < end; chunk++) {
      const slot = slots[Math.floor(chunk / SLOT_CHUNKS)];
      this.#rows[slot].setBelow(chunk % SLOT_CHUNKS, arrived);
      this.#table.touch(slot);
    }
  }
}
