/** Loaded for scenes that are uploaded while their splats are put in order. */
import { GaussianBuffers } from '@gaussian-splat/renderer';
import { sceneBytes, turn, type PackedHead, type PackedPortion } from '@gaussian-splat/renderer/tools';
import type { ScenePart } from '../loading/protocol.js';

/** Bytes that are handed to the GPU before other tasks get the thread. */
const BYTES_AT_ONCE = 1 << 22;

export interface PartUploadOptions {
  readonly signal: AbortSignal;
  /** Bytes of GPU memory that the scene may take; undefined for no limit but the device's. */
  readonly memoryBudget: number | undefined;
  /** Called before the scene is allocated, with its bytes. */
  readonly beforeUpload: (byteLength: number) => void;
}

/** Puts one scene on the GPU, part by part. */
export class PartUploads {
  readonly #device: Promise<GPUDevice>;
  readonly #options: PartUploadOptions;
  #gaussians: Promise<GaussianBuffers> | undefined;
  /** Fulfills once all portions received until now are written. */
  #written: Promise<void> = Promise.resolve();
  #left = BYTES_AT_ONCE;

  /** @param device fulfills once scenes may be allocated on it */
  constructor(device: Promise<GPUDevice>, options: PartUploadOptions) {
    this.#device = device;
    this.#options = options;
  }

  /** Receives parts of the loader. A head starts the upload and discards the previous one. */
  add(part: ScenePart): void {
    if ('head' in part) {
      this.destroy();
      this.#gaussians = this.#allocate(part.head);
      this.#written = this.#gaussians.then(() => undefined);
    } else {
      const gaussians = this.#gaussians;
      this.#written = this.#written.then(() => this.#write(gaussians, part.portion));
    }
    // The load fails with the allocation, and says why.
    this.#written.catch(ignore);
  }

  /** The scene, once its last part has been added. Rejects as {@link GaussianBuffers.upload} does, or with the signal's reason. */
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

  /** Portions that came while the scene was allocated would otherwise be written in one task. */
  async #write(gaussians: Promise<GaussianBuffers> | undefined, portion: PackedPortion): Promise<void> {
    const made = await gaussians;
    // After a restart, portions of the load before it remain.
    if (!made || gaussians !== this.#gaussians) return;
    made.write(portion);
    for (const values of Object.values(portion)) if (ArrayBuffer.isView(values)) this.#left -= values.byteLength;
    if (this.#left > 0) return;
    await turn();
    this.#left = BYTES_AT_ONCE;
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
  // Its result is awaited elsewhere.
}
