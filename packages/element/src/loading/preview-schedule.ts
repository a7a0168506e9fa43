import type { GaussianCloud } from '@gaussian-splat/core';
import { readPrefix } from '@gaussian-splat/formats';

/** Downloads that are over sooner need no preview. */
const FIRST_AFTER_MS = 300;
/** A preview may take this share of the time since the load began: previews must not make loading slow. */
const MAX_SHARE = 0.2;
/** Each preview of a download shows this many times as many bytes as the one before. */
const GROWTH = 1.6;

/** Decides when a part of a scene that is still arriving is shown. */
export class PreviewSchedule {
  readonly #name: string;
  readonly #signal: AbortSignal;
  readonly #onReading: ((isReading: boolean) => void) | undefined;
  readonly #show: (cloud: GaussianCloud) => void;
  readonly #start = performance.now();
  #spentMs = 0;
  #nextBytes = 0;
  /** Splats of the last preview. */
  #shown = 0;

  /**
   * @param show packs and posts a preview
   * @param onReading called before and after it is read
   */
  constructor(
    name: string,
    signal: AbortSignal,
    show: (cloud: GaussianCloud) => void,
    onReading?: (isReading: boolean) => void,
  ) {
    this.#onReading = onReading;
    this.#name = name;
    this.#signal = signal;
    this.#show = show;
  }

  /** For `fetchScene`: shows what has arrived, now and then. */
  readonly onArrival = async (bytes: Uint8Array, total: number | undefined): Promise<void> => {
    const elapsed = performance.now() - this.#start;
    const isDue = elapsed >= FIRST_AFTER_MS && bytes.length >= this.#nextBytes && bytes.length !== total;
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

  /** For `readScene`: shows a selection of the splats, unless more of them are on show. */
  readonly onPreview = (cloud: GaussianCloud): void => {
    if (cloud.count > this.#shown) this.#show(cloud);
  };
}
