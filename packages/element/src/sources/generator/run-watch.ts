import type { Bounds } from '@gaussian-splat/core';
import { ContractError } from '@gaussian-splat/core/contract';

/**
 * Delay of a sample after the last run, ms. A sample reads positions back from the GPU, so none is taken between
 * consecutive runs.
 */
const REST_MS = 700;
/** Maximum number of Gaussians of a scene that is sampled. */
const MAX_COUNT = 1_000_000;

/** The part of the renderer's `DynamicGaussians` that is sampled. */
export interface Watched {
  readonly count: number;
  readSample(): Promise<{ readonly bounds: Bounds; readonly drawn: number; readonly unusable: number }>;
}

/**
 * Samples the Gaussians after a pause of the runs. Reports a run whose rows are all unusable, because nothing is
 * visible although nothing has failed. It is reported again only after a usable run. Transparent Gaussians are not
 * reported, because scenes fade in.
 */
export class RunWatch {
  readonly #gaussians: Watched;
  readonly #where: string;
  readonly #onError: (error: unknown) => void;
  readonly #onBounds: (bounds: Bounds, isFirst: boolean) => void;
  #timer: ReturnType<typeof setTimeout> | undefined;
  #isEmpty = false;

  /**
   * @param gaussians Gaussians of the scene.
   * @param where Name of the model, for the error.
   * @param onError Receives the error of an unusable run.
   * @param onBounds Called with the bounds of a usable sample; `isFirst` is true if the previous sample had no visible
   * Gaussians.
   */
  constructor(
    gaussians: Watched,
    where: string,
    onError: (error: unknown) => void,
    onBounds: (bounds: Bounds, isFirst: boolean) => void,
  ) {
    this.#gaussians = gaussians;
    this.#where = where;
    this.#onError = onError;
    this.#onBounds = onBounds;
  }

  /**
   * Call when a run is shown. A sample of the Gaussians is read {@link REST_MS} milliseconds after the last call, unless
   * there are more than {@link MAX_COUNT}.
   */
  frameMade(): void {
    clearTimeout(this.#timer);
    if (this.#gaussians.count > MAX_COUNT) return;
    this.#timer = setTimeout(() => void this.#look(), REST_MS);
  }

  close(): void {
    clearTimeout(this.#timer);
  }

  async #look(): Promise<void> {
    const sample = await this.#gaussians.readSample().catch(() => undefined);
    // The scene has been closed, so nothing is reported.
    if (sample === undefined) return;
    const { bounds, drawn, unusable } = sample;
    const isEmpty = drawn === 0;
    if (isEmpty && !this.#isEmpty && unusable > 0) this.#onError(notDrawable(this.#where, unusable));
    if (!isEmpty) this.#onBounds(bounds, this.#isEmpty);
    this.#isEmpty = isEmpty;
  }
}

const notDrawable = (where: string, unusable: number): ContractError =>
  new ContractError([
    {
      code: 'contract/not-finite',
      where,
      expected: 'Gaussians that can be drawn',
      found: `a run without any: ${unusable} rows have numbers that are not finite, no extent, or a rotation of zeros`,
      remedy: 'look for a division by zero: "gaussian-splat check MODEL --run" reports the inputs',
    },
  ]);
