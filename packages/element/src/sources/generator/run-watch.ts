import type { Bounds } from '@gaussian-splat/core';
import { ContractError, type ContractFault } from '@gaussian-splat/core/contract';

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
  readSample(): Promise<{
    readonly bounds: Bounds;
    readonly drawn: number;
    readonly unusable: number;
    readonly counted?: { readonly count: number; readonly rows: number };
  }>;
}

/** Properties of a watched scene. */
export interface WatchOptions {
  /** Name of the model, for errors. */
  readonly where: string;
  /** Returns a promise that fulfills when no run is in progress. */
  readonly idle: () => Promise<void>;
  /** Receives the error of an unusable run. */
  readonly onError: (error: unknown) => void;
  /**
   * Called with the bounds of a usable sample; `isFirst` is true if the previous sample had no visible Gaussians.
   */
  readonly onBounds: (bounds: Bounds, isFirst: boolean) => void;
}

/**
 * Samples the Gaussians after a pause of the runs. Reports a run whose rows are all unusable, because nothing is
 * visible although nothing has failed, and a count of rows that is out of range. Each is reported again only after a run
 * without it. Transparent Gaussians are not reported, because scenes fade in.
 */
export class RunWatch {
  readonly #gaussians: Watched;
  readonly #options: WatchOptions;
  #timer: ReturnType<typeof setTimeout> | undefined;
  #runs = 0;
  #isEmpty = false;
  #isMiscounted = false;

  constructor(gaussians: Watched, options: WatchOptions) {
    this.#gaussians = gaussians;
    this.#options = options;
  }

  /**
   * Call when a run is shown. A sample of the Gaussians is read {@link REST_MS} milliseconds after the last call if no run
   * is in progress then, unless there are more than {@link MAX_COUNT}.
   */
  frameMade(): void {
    clearTimeout(this.#timer);
    this.#runs++;
    if (this.#gaussians.count > MAX_COUNT) return;
    this.#timer = setTimeout(() => void this.#look(), REST_MS);
  }

  close(): void {
    clearTimeout(this.#timer);
  }

  async #look(): Promise<void> {
    const runs = this.#runs;
    await this.#options.idle();
    // The next run, which takes longer than the pause, is sampled instead.
    if (runs !== this.#runs) return;
    const sample = await this.#gaussians.readSample().catch(() => undefined);
    // The scene has been closed, so nothing is reported.
    if (sample === undefined) return;
    const { where, onError, onBounds } = this.#options;
    const { bounds, drawn, unusable, counted } = sample;
    const isMiscounted = counted !== undefined && (counted.count < 0 || counted.count > counted.rows);
    if (isMiscounted && !this.#isMiscounted) onError(miscounted(where, counted));
    this.#isMiscounted = isMiscounted;
    const isEmpty = drawn === 0;
    if (isEmpty && !this.#isEmpty && unusable > 0) onError(notDrawable(where, unusable));
    if (!isEmpty) onBounds(bounds, this.#isEmpty);
    this.#isEmpty = isEmpty;
  }
}

const fault = (found: Omit<ContractFault, 'where'>, where: string): ContractError =>
  new ContractError([{ ...found, where }]);

const notDrawable = (where: string, unusable: number): ContractError =>
  fault(
    {
      code: 'contract/not-finite',
      expected: 'Gaussians that can be drawn',
      found: `a run without any: ${unusable} rows have numbers that are not finite, no extent, or a rotation of zeros`,
      remedy: 'look for a division by zero: "gaussian-splat check MODEL --run" reports the inputs',
    },
    where,
  );

const miscounted = (where: string, { count, rows }: { readonly count: number; readonly rows: number }): ContractError =>
  fault(
    {
      code: 'contract/count',
      expected: `a count of 0 to ${rows}, the number of rows`,
      found: `${count}; ${count < 0 ? 'no row is' : 'all rows are'} drawn`,
      remedy: 'clamp the count in the model',
    },
    where,
  );
