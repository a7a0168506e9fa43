import type { LoadedScene } from '../../loading/protocol.js';
import type { LoadedGaussians } from '../../gpu/loaded-gaussians.js';
import { withLease, type SharedDevice } from '../../gpu/shared-device.js';
import { upload, type SceneUploadOptions } from './upload.js';

export interface PreviewUploadOptions extends SceneUploadOptions {
  readonly device: SharedDevice;
  /** Resolves when variants for the first frame are selected, so that previews can be drawn. */
  readonly ready: Promise<unknown>;
  readonly onPreview: (preview: LoadedGaussians) => void;
}

/**
 * Uploads the previews of one load, one at a time. Of the previews that arrive during an upload, only the latest is
 * uploaded next.
 */
export class PreviewUploads {
  readonly #options: PreviewUploadOptions;
  readonly #over = new AbortController();
  #next: LoadedScene | undefined;
  #isBusy = false;

  constructor(options: PreviewUploadOptions) {
    this.#options = options;
  }

  /** Uploads a preview as soon as possible, and passes it to `onPreview`. It replaces a preview that still waits. */
  readonly show = (preview: LoadedScene): void => {
    this.#next = preview;
    if (!this.#isBusy) void this.#run();
  };

  /** Discards pending previews. Call when the complete scene has arrived, or the load has failed. */
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
      // The same failure affects the complete scene, whose load reports it.
    } finally {
      this.#isBusy = false;
    }
  }

  async #upload(preview: LoadedScene): Promise<void> {
    const { device, ready, onPreview, signal, ...options } = this.#options;
    await ready;
    const either = AbortSignal.any([signal, this.#over.signal]);
    await withLease(device, async (acquiring) => {
      const lease = await acquiring;
      either.throwIfAborted();
      onPreview(await upload(lease, preview, { ...options, signal: either }));
    });
  }
}
