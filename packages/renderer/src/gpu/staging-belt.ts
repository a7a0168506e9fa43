import { BUFFER_USAGE } from './kernel.js';
import type { GpuMemory } from './memory.js';

/**
 * Bytes of a staging block. A partly filled block is transferred completely; larger ones were hardly faster to fill
 * (docs/lod-format.md).
 */
export const BLOCK_BYTES = 1 << 18;

/** Mapped memory, and the number of its bytes in use. */
interface Block {
  readonly buffer: GPUBuffer;
  words: Uint32Array<ArrayBuffer>;
  used: number;
  readonly copies: { readonly to: GPUBuffer; readonly at: number; readonly from: number; readonly words: number }[];
}

/**
 * Writes to GPU buffers through a fixed number of blocks that are mapped on the main thread and allocated once: a copy
 * into mapped memory takes a third of the time of `queue.writeBuffer`. {@link StagingBelt.record} records the copies to
 * the GPU; a block is reused when the GPU has finished with it.
 */
export class StagingBelt {
  readonly #free: Block[] = [];
  readonly #filled: Block[] = [];
  /** Blocks whose copies are recorded. */
  #leaving: Block[] = [];

  /** @param blocks Number of blocks of {@link BLOCK_BYTES} each; they become writable once the device has mapped them. */
  constructor(memory: GpuMemory, label: string, blocks: number) {
    for (let k = 0; k < blocks; k++) {
      const buffer = memory.buffer(label, BLOCK_BYTES, BUFFER_USAGE.mapWrite | BUFFER_USAGE.copySource);
      this.#map({ buffer, words: new Uint32Array(0), used: 0, copies: [] });
    }
  }

  /** Whether nothing has been written since the last {@link record}. */
  get isEmpty(): boolean {
    return this.#filled.length === 0;
  }

  /**
   * Copies words into staging blocks; {@link record} records their copy to the buffer.
   * @param at Byte offset of the first word in the buffer, a multiple of 4.
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
   * Records the copies of everything written since the last call. The commands must be submitted, and {@link recall}
   * called, before anything else is written.
   */
  record(encoder: GPUCommandEncoder): void {
    for (const { buffer, copies } of this.#filled) {
      buffer.unmap();
      for (const { to, at, from, words } of copies) encoder.copyBufferToBuffer(buffer, from, to, at, 4 * words);
      copies.length = 0;
    }
    this.#leaving = this.#filled.splice(0);
  }

  /** Maps the blocks again whose copies have been submitted. */
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

/** `GPUMapMode.WRITE` as a number, because modules access no browser global on import. */
const MAP_WRITE = 2;
