import { BUFFER_USAGE } from '../gpu/kernel.js';
import type { GpuMemory } from '../gpu/memory.js';

/** Frames between two looks at what is wished for. */
const INTERVAL = 6;

/** Brings what views wish for back from the GPU, now and then, with nobody waiting for it. */
export class WishReader {
  /** For each page the bits of a float32, cleared before each look. */
  readonly buffer: GPUBuffer;
  readonly #staging: GPUBuffer;
  readonly #onWishes: (wishes: Float32Array) => void;
  #frame = 0;
  #isReading = false;

  constructor(memory: GpuMemory, pages: number, onWishes: (wishes: Float32Array) => void) {
    const { storage, copySource, copyDestination, mapRead } = BUFFER_USAGE;
    this.buffer = memory.buffer('gs.wishes', 4 * pages, storage | copySource | copyDestination);
    this.#staging = memory.buffer('gs.wishes.staging', 4 * pages, mapRead | copyDestination);
    this.#onWishes = onWishes;
  }

  /** True for a frame that must note wishes; then {@link begin}, {@link copy} and, after the submit, {@link read} follow. */
  isDue(): boolean {
    return this.#frame++ % INTERVAL === 0 && !this.#isReading;
  }

  begin(encoder: GPUCommandEncoder): void {
    encoder.clearBuffer(this.buffer);
  }

  copy(encoder: GPUCommandEncoder): void {
    encoder.copyBufferToBuffer(this.buffer, 0, this.#staging, 0, this.buffer.size);
    this.#isReading = true;
  }

  read(): void {
    this.#staging.mapAsync(0x1).then(
      () => {
        const wishes = new Float32Array(this.#staging.getMappedRange().slice(0));
        this.#staging.unmap();
        this.#isReading = false;
        this.#onWishes(wishes);
      },
      // The device is lost, or the scene was destroyed meanwhile.
      () => undefined,
    );
  }
}
