import type { GaussianCloud } from '@gaussian-splat/core';
import { readPrefix } from '@gaussian-splat/formats';

/** Maximum fraction of the time since the start of the load for previews, so that they do not slow loading. */
const MAX_SHARE = 0.2;
/** Ratio of the bytes in consecutive previews of a download. */
const GROWTH = 1.6;

/** Loaded for slow scenes. Decides when a part of a scene that is still arriving is shown. */
export class PreviewSchedule {
  readonly #name: string;
  readonly #signal: AbortSignal;
  readonly #onReading: ((isReading: boolean) => void) | undefined;
  readonly #show: (cloud: GaussianCloud) => void;
  readonly #start: number;
  #spentMs = 0;
  #nextBytes = 0;
  /** Splats of the last preview. */
  #shown = 0;

  /**
   * @param start Start of the load, ms.
   * @param show Packs and posts a preview.
   * @param onReading Called before and after it is read.
   */
  constructor(
    name: string,
    signal: AbortSignal,
    start: number,
    show: (cloud: GaussianCloud) => void,
    onReading?: (isReading: boolean) => void,
  ) {
    this.#start = start;
    this.#onReading = onReading;
    this.#name = name;
    this.#signal = signal;
    this.#show = show;
  }

  /** For `fetchScene`: shows the received part at intervals. */
  readonly onArrival = async (bytes: Uint8Array, total: number | undefined): Promise<void> => {
    const elapsed = performance.now() - this.#start;
    const isDue = bytes.length >= this.#nextBytes && bytes.length !== total;
    if (!isDue || this.#spentMs > MAX_SHARE * elapsed) return;
    const began = performance.now();
    this.#onReading?.(true);
    const cloud = await readPrefix(bytes, { name: this.#name, signal: this.#signal });
    if (cloud !== undefined) {
      this.#show(cloud);
      this.#shown = cloud.count;
    }
    this.#onReading?.(false);
    this.#spentMs += performance.now() - began;
    this.#nextBytes = GROWTH * bytes.length;
  };

  /** For `readScene`: shows a selection of the splats, unless more of them are shown already. */
  readonly onPreview = (cloud: GaussianCloud): void => {
    if (cloud.count > this.#shown) this.#show(cloud);
  };
}
