import { BUFFER_USAGE } from './kernel.js';
import type { GpuMemory } from './memory.js';

/**
 * Number of bytes of a staging block. A partly filled block is transferred completely. Larger blocks were hardly faster
 * to fill (docs/lod-format.md).
 */
export const BLOCK_BYTES = 1 << 18;

/** A block of mapped memory, and the copies from it. */
interface Block {
  readonly buffer: GPUBuffer;
  /** Mapped memory of the block; empty while the block is not mapped. */
  words: Uint32Array<ArrayBuffer>;
  /** Number of words in use. */
  used: number;
  readonly copies: { readonly to: GPUBuffer; readonly at: number; readonly from: number; readonly words: number }[];
}

/**
 * Writes to GPU buffers through a fixed number of staging blocks, which are allocated once and mapped on the main
 * thread. A copy to mapped memory takes a third of the time of `queue.writeBuffer`. {@link StagingBelt.record} records
 * the copies to the buffers. A block is reused when the GPU has executed its copies.
 */
export class StagingBelt {
  readonly #free: Block[] = [];
  readonly #filled: Block[] = [];
  /** Blocks whose copies are recorded but not yet submitted. */
  #leaving: Block[] = [];

  /** @param blocks Number of blocks of {@link BLOCK_BYTES} each. A block is writable once the device has mapped it. */
  constructor(memory: GpuMemory, label: string, blocks: number) {
    for (let k = 0; k < blocks; k++) {
      const buffer = memory.buffer(label, BLOCK_BYTES, BUFFER_USAGE.mapWrite | BUFFER_USAGE.copySource);
      this.#map({ buffer, words: new Uint32Array(0), used: 0, copies: [] });
    }
  }

  /** Whether no words were written since the last {@link record}. */
  get isEmpty(): boolean {
    return this.#filled.length === 0;
  }

  /**
   * Copies words to staging blocks; {@link record} then records their copy to a buffer.
   * @param to Destination buffer.
   * @param at Byte offset of the first word in this buffer, a multiple of 4.
   * @returns Number of words, from the first on, that fit the available blocks.
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

  /**
   * Records the copies of all words written since the last call. Before the next write, submit the commands and call
   * {@link recall}.
   */
  record(encoder: GPUCommandEncoder): void {
    for (const { buffer, copies } of this.#filled) {
      buffer.unmap();
      for (const { to, at, from, words } of copies) encoder.copyBufferToBuffer(buffer, from, to, at, 4 * words);
      copies.length = 0;
    }
    this.#leaving = this.#filled.splice(0);
  }

  /** Maps the blocks again whose copies were submitted. */
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
      // Fails if the buffer was destroyed or its device is lost.
      () => undefined,
    );
  }
}

/** `GPUMapMode.WRITE` as a number, because modules access no browser global on import. */
const MAP_WRITE = 2;
