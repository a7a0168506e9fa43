import type { LoadedScene } from '../loading/protocol.js';
import type { LoadedGaussians } from './loaded-gaussians.js';
import type { SharedDevice } from './shared-device.js';
import { upload, type SceneUploadOptions } from './upload.js';

export interface PreviewUploadOptions extends SceneUploadOptions {
  readonly device: SharedDevice;
  /** Resolves when the device is ready to draw. */
  readonly ready: Promise<unknown>;
  readonly onPreview: (preview: LoadedGaussians) => void;
}

/** Uploads the previews of one load, one at a time; of those that arrive meanwhile the latest is next. */
export class PreviewUploads {
  readonly #options: PreviewUploadOptions;
  readonly #over = new AbortController();
  #next: LoadedScene | undefined;
  #isBusy = false;

  constructor(options: PreviewUploadOptions) {
    this.#options = options;
  }

  /** Callback for the loader. */
  readonly show = (preview: LoadedScene): void => {
    this.#next = preview;
    if (!this.#isBusy) void this.#run();
  };

  /** Call when the whole scene has arrived, or the load has failed: discards pending previews. */
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
      // A failure here also affects the whole scene, whose load reports it.
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
