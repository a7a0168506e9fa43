import { DETAIL_NUMBERS } from '../levels/chunk-detail.js';
import { SLOT_CHUNKS } from './manifest.js';

const SLOT_NUMBERS = DETAIL_NUMBERS * SLOT_CHUNKS;
/**
 * Unchanged slots between changed ones are written as well, up to this number: their 8 kB cost less than another write.
 */
export const BRIDGED = 40;

/** CPU copy of the LOD rows of all slots. Changes are written once in each frame, neighbors in one range. */
export class DetailTable {
  readonly #numbers: Float32Array<ArrayBuffer>;
  readonly #isChanged: Uint8Array;
  #hasChanged = false;

  constructor(slots: number) {
    this.#numbers = new Float32Array(SLOT_NUMBERS * slots);
    this.#isChanged = new Uint8Array(slots);
  }

  /** The rows of a slot; {@link touch} must follow a change. */
  rowsOf(slot: number): Float32Array<ArrayBuffer> {
    return this.#numbers.subarray(SLOT_NUMBERS * slot, SLOT_NUMBERS * (slot + 1));
  }

  touch(slot: number): void {
    this.#isChanged[slot] = 1;
    this.#hasChanged = true;
  }

  /**
   * Writes the changes since the last call.
   * @param slotsPerBuffer A range never crosses a multiple of it.
   * @param write Is called with the first slot of a range and the rows of its slots.
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
