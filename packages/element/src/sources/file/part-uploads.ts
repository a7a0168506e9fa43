/** Uploads scenes while their splats are sorted. The module is loaded for the first such scene. */
import { GaussianBuffers } from '@gaussian-splat/renderer';
import { sceneBytes, type BlockBuffers, type PackedHead, type PackedPortion } from '@gaussian-splat/renderer/tools';
import type { ScenePart } from '../../loading/protocol.js';

export interface PartUploadOptions {
  readonly signal: AbortSignal;
  /** Maximum GPU memory of the scene, in bytes; undefined if only the device limits it. */
  readonly memoryBudget: number | undefined;
  /** Called with the GPU memory of the scene, in bytes, before it is allocated. */
  readonly beforeUpload: (byteLength: number) => void;
}

/** Uploads one scene to the GPU, part by part. */
export class PartUploads {
  readonly #device: Promise<GPUDevice>;
  readonly #options: PartUploadOptions;
  #gaussians: Promise<GaussianBuffers> | undefined;
  /** Resolves when all portions that have been received are written. */
  #written: Promise<void> = Promise.resolve();

  /** @param device Resolves with the device when scenes may be allocated on it. */
  constructor(device: Promise<GPUDevice>, options: PartUploadOptions) {
    this.#device = device;
    this.#options = options;
  }

  /**
   * Adds a part that the loader has sent. A head starts a new upload, and discards the previous one. Resolves with the
   * buffers of the part when they are no longer needed.
   */
  add(part: ScenePart): Promise<BlockBuffers | undefined> {
    if ('head' in part) {
      this.destroy();
      this.#gaussians = this.#allocate(part.head);
      this.#written = this.#gaussians.then(() => undefined);
    } else {
      const gaussians = this.#gaussians;
      this.#written = this.#written.then(() => this.#write(gaussians, part.portion));
    }
    // `finish` reports a failed allocation.
    this.#written.catch(ignore);
    return this.#written.then(() =>
      'portion' in part && part.portion.geometry ? (part.portion as BlockBuffers) : undefined,
    );
  }

  /**
   * Returns the scene when all parts are written. Call after the last part was added. Rejects as {@link
   * GaussianBuffers.upload} does, or with the signal's reason.
   */
  async finish(): Promise<GaussianBuffers> {
    await this.#written;
    const gaussians = await this.#gaussians!;
    this.#options.signal.throwIfAborted();
    return gaussians;
  }

  destroy(): void {
    this.#gaussians?.then((gaussians) => gaussians.destroy(), ignore);
    this.#gaussians = undefined;
  }

  async #write(gaussians: Promise<GaussianBuffers> | undefined, portion: PackedPortion): Promise<void> {
    const made = await gaussians;
    // Portions that were sent before a restart of the load are ignored.
    if (gaussians !== this.#gaussians) return;
    await made?.write(portion);
  }

  async #allocate(head: PackedHead): Promise<GaussianBuffers> {
    const { signal, memoryBudget, beforeUpload } = this.#options;
    const device = await this.#device;
    signal.throwIfAborted();
    beforeUpload(sceneBytes(head));
    return GaussianBuffers.allocate(device, head, { memoryBudget });
  }
}

function ignore(): void {
  // Other code awaits the promise and handles its failure.
}
