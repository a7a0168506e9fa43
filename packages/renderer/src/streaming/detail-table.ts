import { DETAIL_NUMBERS } from '../levels/chunk-detail.js';
import { SLOT_CHUNKS } from './manifest.js';

const SLOT_NUMBERS = DETAIL_NUMBERS * SLOT_CHUNKS;
/** Slots without a change that are written along with those on both sides: their 8 kB cost less than another write. */
export const BRIDGED = 40;

/** The detail rows of all slots as they should be on the GPU. What has changed is written once a frame, neighbours in one piece. */
export class DetailTable {
  readonly #numbers: Float32Array<ArrayBuffer>;
  readonly #isChanged: Uint8Array;
  #hasChanged = false;

  constructor(slots: number) {
    this.#numbers = new Float32Array(SLOT_NUMBERS * slots);
    this.#isChanged = new Uint8Array(slots);
  }

  /** The numbers of a slot; {@link touch} must follow a change. */
  rowsOf(slot: number): Float32Array<ArrayBuffer> {
    return this.#numbers.subarray(SLOT_NUMBERS * slot, SLOT_NUMBERS * (slot + 1));
  }

  touch(slot: number): void {
    this.#isChanged[slot] = 1;
    this.#hasChanged = true;
  }

  /**
   * Hands over what has changed since the last time.
   * @param slotsPerBuffer a piece never reaches over a multiple of it
   * @param write gets the first slot of a piece and the rows of its slots
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
