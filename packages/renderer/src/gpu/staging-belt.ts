import { BUFFER_USAGE } from './kernel.js';
import type { GpuMemory } from './memory.js';

/** Bytes of a block. Of one that is not full all of it is transferred; larger ones were hardly faster to fill (docs/lod-format.md). */
export const BLOCK_BYTES = 1 << 18;

/** Mapped memory, and how much of it has been written. */
interface Block {
  readonly buffer: GPUBuffer;
  words: Uint32Array<ArrayBuffer>;
  used: number;
  readonly copies: { readonly to: GPUBuffer; readonly at: number; readonly from: number; readonly words: number }[];
}

/**
 * Writes to GPU buffers through blocks that the page's thread has mapped, a fixed number of them, allocated once: a copy into mapped memory takes the thread a third of what
 * `queue.writeBuffer` takes. What is written is on its way with {@link StagingBelt.record}, and a block comes back when the GPU is done with it.
 */
export class StagingBelt {
  readonly #free: Block[] = [];
  readonly #filled: Block[] = [];
  /** Those whose copies are recorded. */
  #leaving: Block[] = [];

  /** @param blocks of {@link BLOCK_BYTES} each; they can be written to when the device has mapped them, a little later */
  constructor(memory: GpuMemory, label: string, blocks: number) {
    for (let k = 0; k < blocks; k++) {
      const buffer = memory.buffer(label, BLOCK_BYTES, BUFFER_USAGE.mapWrite | BUFFER_USAGE.copySource);
      this.#map({ buffer, words: new Uint32Array(0), used: 0, copies: [] });
    }
  }

  /** Nothing has been written since the last {@link record}. */
  get isEmpty(): boolean {
    return this.#filled.length === 0;
  }

  /**
   * Copies words, to be written to a buffer by what {@link record} records.
   * @param at byte of the buffer that the first word goes to, a multiple of 4
   * @returns how many of the words, from the first on, had room in the blocks that are there
   */
  write(to: GPUBuffer, at: number, words: Uint32Array): number {
    let taken = 0;
    while (taken < words.length) {
      const block = this.#blockWithRoom();
      if (block === undefined) break;
      const { used } = block;
      const some = words.subarray(taken, taken + block.words.length - used);
      block.words.set(some, used);
      block.copies.push({ to, at: at + 4 * taken, from: 4 * used, words: some.length });
      block.used += some.length;
      taken += some.length;
    }
    return taken;
  }

  /** Records the copies of all that was written since. The commands must be submitted, and {@link recall} called, before anything else is written. */
  record(encoder: GPUCommandEncoder): void {
    for (const { buffer, copies } of this.#filled) {
      buffer.unmap();
      for (const { to, at, from, words } of copies) encoder.copyBufferToBuffer(buffer, from, to, at, 4 * words);
      copies.length = 0;
    }
    this.#leaving = this.#filled.splice(0);
  }

  /** Asks for the blocks back whose copies have been submitted. */
  recall(): void {
    this.#leaving.splice(0).forEach((block) => this.#map(block));
  }

  #blockWithRoom(): Block | undefined {
    const last = this.#filled.at(-1);
    if (last !== undefined && last.used < last.words.length) return last;
    const next = this.#free.pop();
    if (next !== undefined) this.#filled.push(next);
    return next;
  }

  #map(block: Block): void {
    const { buffer } = block;
    buffer.mapAsync(MAP_WRITE).then(
      () => {
        block.words = new Uint32Array(buffer.getMappedRange());
        block.used = 0;
        this.#free.push(block);
      },
      // The buffer has been destroyed, or its device is lost.
      () => undefined,
    );
  }
}

/** `GPUMapMode.WRITE`, a number, as no global of a browser is touched where there may be none. */
const MAP_WRITE = 2;
