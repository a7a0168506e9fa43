import type { GaussianCloud } from '@gaussian-splat/core';
import { readPrefix, type ReadSceneOptions } from '@gaussian-splat/formats';

/** Maximum fraction of the loading time that previews may take, so that they do not slow the load. */
const MAX_SHARE = 0.2;
/** Minimum remaining time of the download for which a preview is shown, ms. */
const MIN_REST_MS = 500;
/** Growth of the number of received bytes from one preview to the next. */
const GROWTH = 1.6;

/** Decides when the received part of a scene is shown as a preview. Loaded only for slow scenes. */
export class PreviewSchedule {
  readonly #options: ReadSceneOptions;
  readonly #onReading: ((isReading: boolean) => void) | undefined;
  readonly #show: (cloud: GaussianCloud) => void | Promise<void>;
  readonly #start: number;
  #spentMs = 0;
  #nextBytes = 0;
  /** Number of splats in the last preview. */
  #shown = 0;

  /**
   * @param options Name, signal and limits of the load.
   * @param start Start of the load, in milliseconds of `performance.now()`.
   * @param show Packs and posts a preview.
   * @param onReading Called with true before the part is read, and with false after.
   */
  constructor(
    options: ReadSceneOptions,
    start: number,
    show: (cloud: GaussianCloud) => void | Promise<void>,
    onReading?: (isReading: boolean) => void,
  ) {
    this.#start = start;
    this.#onReading = onReading;
    this.#options = options;
    this.#show = show;
  }

  /** Listener for `fetchScene`: shows the received part if a preview is due. */
  readonly onArrival = async (bytes: Uint8Array, total: number | undefined): Promise<void> => {
    const elapsed = performance.now() - this.#start;
    const isDue = bytes.length >= this.#nextBytes && bytes.length !== total;
    if (!isDue || this.#spentMs > MAX_SHARE * elapsed) return;
    // The rest of the file would arrive before a preview is drawn.
    if (total !== undefined && elapsed * (total - bytes.length) < MIN_REST_MS * bytes.length) return;
    const began = performance.now();
    this.#onReading?.(true);
    const cloud = await readPrefix(bytes, this.#options);
    if (cloud !== undefined) {
      await this.#show(cloud);
      this.#shown = cloud.count;
    }
    this.#onReading?.(false);
    this.#spentMs += performance.now() - began;
    this.#nextBytes = GROWTH * bytes.length;
  };

  /** Listener for `readScene`: shows a selection of the splats, unless the last preview has more. */
  readonly onPreview = async (cloud: GaussianCloud): Promise<void> => {
    if (cloud.count > this.#shown) await this.#show(cloud);
  };
}
