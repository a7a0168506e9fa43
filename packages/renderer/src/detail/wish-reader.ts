import type { NotedPage, Wishes } from '../gaussian-scene.js';
import { BUFFER_USAGE } from '../gpu/kernel.js';
import type { GpuMemory } from '../gpu/memory.js';
import { NoteWishesStage } from '../stages/note-wishes.js';

/** Frames between two looks at what is wished for. */
const INTERVAL = 6;
/** Milliseconds after which a view that nobody has looked at is drawn once more, to look. */
const STALE_MS = 120;

/** Brings what views wish for back from the GPU, now and then, with nobody waiting for it. */
export class WishReader implements Wishes {
  readonly #stage: NoteWishesStage;
  /** For each page the bits of the pixels that doing without it costs, a float32; cleared before each look. */
  readonly #wishes: GPUBuffer;
  readonly #staging: GPUBuffer;
  readonly #onWishes: (wishes: Float32Array) => void;
  readonly #onStale: () => void;
  #frames = INTERVAL;
  #timer: ReturnType<typeof setTimeout> | undefined;
  #isReading = false;

  /**
   * @param onWishes called with the pixels that doing without each page costs
   * @param onStale called when the last view has not been looked at for want of another frame
   */
  constructor(
    device: GPUDevice,
    memory: GpuMemory,
    pages: number,
    onWishes: (wishes: Float32Array) => void,
    onStale: () => void,
  ) {
    this.#stage = new NoteWishesStage(device);
    const { storage, copySource, copyDestination, mapRead } = BUFFER_USAGE;
    this.#wishes = memory.buffer('gs.wishes', 4 * pages, storage | copySource | copyDestination);
    this.#staging = memory.buffer('gs.wishes.staging', 4 * pages, mapRead | copyDestination);
    this.#onWishes = onWishes;
    this.#onStale = onStale;
  }

  /** True for a frame that must note wishes; then {@link begin}, {@link note}, {@link copy} and, after the submit, {@link read} follow. */
  isDue(): boolean {
    clearTimeout(this.#timer);
    const isDue = this.#frames >= INTERVAL && !this.#isReading;
    this.#frames = isDue ? 1 : this.#frames + 1;
    if (!isDue) this.#timer = setTimeout(() => this.#look(), STALE_MS);
    return isDue;
  }

  destroy(): void {
    clearTimeout(this.#timer);
  }

  #look(): void {
    this.#frames = INTERVAL;
    this.#onStale();
  }

  begin(encoder: GPUCommandEncoder): void {
    encoder.clearBuffer(this.#wishes);
  }

  bind(page: NotedPage): GPUBindGroup {
    return this.#stage.bind({ ...page, wishes: this.#wishes });
  }

  note(pass: GPUComputePassEncoder, bindings: GPUBindGroup, splatCount: number): void {
    this.#stage.record(pass, bindings, splatCount);
  }

  copy(encoder: GPUCommandEncoder): void {
    encoder.copyBufferToBuffer(this.#wishes, 0, this.#staging, 0, this.#wishes.size);
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
