import type { LoadedScene } from '../loading/protocol.js';
import type { LoadedGaussians } from './loaded-gaussians.js';
import type { SharedDevice } from './shared-device.js';
import { upload, type SceneUploadOptions } from './upload.js';

export interface PreviewUploadOptions extends SceneUploadOptions {
  readonly device: SharedDevice;
  /** Fulfils when the device is ready to draw. */
  readonly ready: Promise<unknown>;
  readonly onPreview: (preview: LoadedGaussians) => void;
}

/** Puts the previews of one load on the GPU, one at a time; of those that come meanwhile the latest is next. */
export class PreviewUploads {
  readonly #options: PreviewUploadOptions;
  readonly #over = new AbortController();
  #next: LoadedScene | undefined;
  #isBusy = false;

  constructor(options: PreviewUploadOptions) {
    this.#options = options;
  }

  /** For the loader. */
  readonly show = (preview: LoadedScene): void => {
    this.#next = preview;
    if (!this.#isBusy) void this.#run();
  };

  /** The whole scene has come, or nothing will: what is under way is dropped. */
  end(): void {
    this.#next = undefined;
    this.#over.abort();
  }

  async #run(): Promise<void> {
    this.#isBusy = true;
    try {
      while (this.#next !== undefined) {
        const preview = this.#next;
        this.#next = undefined;
        await this.#upload(preview);
      }
    } catch {
      // What keeps a preview from the GPU keeps the whole scene from it, too, and that load says so.
    } finally {
      this.#isBusy = false;
    }
  }

  async #upload(preview: LoadedScene): Promise<void> {
    const { device, ready, onPreview, signal, ...options } = this.#options;
    await ready;
    const lease = await device.acquire();
    const either = AbortSignal.any([signal, this.#over.signal]);
    try {
      either.throwIfAborted();
      onPreview(await upload(lease, preview, { ...options, signal: either }));
    } catch (error) {
      lease.release();
      throw error;
    }
  }
}
