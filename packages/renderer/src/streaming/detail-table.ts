import { DETAIL_NUMBERS } from '../levels/chunk-detail.js';
import { SLOT_CHUNKS } from './manifest.js';

const SLOT_NUMBERS = DETAIL_NUMBERS * SLOT_CHUNKS;
/**
 * Maximum number of unchanged slots between two changed ones that are written together with them. These 8 kB cost less
 * than another write.
 */
export const BRIDGED = 40;

/**
 * CPU copy of the LOD rows of all slots. Changed rows are written once in each frame; neighboring slots are written
 * together.
 */
export class DetailTable {
  readonly #numbers: Float32Array<ArrayBuffer>;
  readonly #isChanged: Uint8Array;
  #hasChanged = false;

  constructor(slots: number) {
    this.#numbers = new Float32Array(SLOT_NUMBERS * slots);
    this.#isChanged = new Uint8Array(slots);
  }

  /** Returns the rows of a slot as a view of the table. Call {@link touch} after a change. */
  rowsOf(slot: number): Float32Array<ArrayBuffer> {
    return this.#numbers.subarray(SLOT_NUMBERS * slot, SLOT_NUMBERS * (slot + 1));
  }

  /** Marks the rows of a slot as changed. */
  touch(slot: number): void {
    this.#isChanged[slot] = 1;
    this.#hasChanged = true;
  }

  /**
   * Writes the rows that changed since the last call.
   * @param slotsPerBuffer Number of slots in a buffer; a range of slots never crosses two buffers.
   * @param write Called with the first slot of a range, and the rows of all its slots.
   */
  flush(slotsPerBuffer: number, write: (slot: number, rows: Float32Array<ArrayBuffer>) => void): void {
    if (!this.#hasChanged) return;
    this.#hasChanged = false;
    const changed = this.#isChanged;
    for (let first = changed.indexOf(1); first >= 0;) {
      const end = Math.min(changed.length, slotsPerBuffer * (Math.floor(first / slotsPerBuffer) + 1));
      let last = first;
      for (let slot = first + 1; slot < end && slot <= last + BRIDGED + 1; slot++) if (changed[slot] === 1) last = slot;
      write(first, this.#numbers.subarray(SLOT_NUMBERS * first, SLOT_NUMBERS * (last + 1)));
      changed.fill(0, first, last + 1);
      first = changed.indexOf(1, last + 1);
    }
  }
}
