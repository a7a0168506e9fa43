/** Loaded for scenes that are uploaded while their splats are put in order. */
import { GaussianBuffers } from '@gaussian-splat/renderer';
import { sceneBytes, type PackedHead } from '@gaussian-splat/renderer/tools';
import type { ScenePart } from '../loading/protocol.js';

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

  /** @param device fulfils once scenes may be allocated on it */
  constructor(device: Promise<GPUDevice>, options: PartUploadOptions) {
    this.#device = device;
    this.#options = options;
  }

  /** For the loader. A head begins the upload, and discards what came before it. */
  add(part: ScenePart): void {
    if ('head' in part) {
      this.destroy();
      this.#gaussians = this.#allocate(part.head);
    }
    const { portion } = part as Extract<ScenePart, { portion: unknown }>;
    // The load fails with the allocation, and says why.
    this.#gaussians?.then((gaussians) => portion && gaussians.write(portion), ignore);
  }

  /** The scene, once its last part has been added. Rejects as {@link GaussianBuffers.upload} does, or with the signal's reason. */
  async finish(): Promise<GaussianBuffers> {
    const gaussians = await this.#gaussians!;
    this.#options.signal.throwIfAborted();
    return gaussians;
  }

  destroy(): void {
    this.#gaussians?.then((gaussians) => gaussians.destroy(), ignore);
    this.#gaussians = undefined;
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
  // What matters of it is awaited elsewhere.
}
