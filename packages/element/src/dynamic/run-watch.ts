import type { Bounds } from '@gaussian-splat/core';
import { ContractError } from '@gaussian-splat/core/contract';

/** Delay after the last run, ms: a sample reads positions back, so there is none during consecutive runs. */
const REST_MS = 700;
/** Maximum number of Gaussians for sampling. */
const MAX_COUNT = 1_000_000;

/** Interface of `DynamicGaussians` of the renderer. */
export interface Watched {
  readonly count: number;
  readSample(): Promise<{ readonly bounds: Bounds; readonly drawn: number; readonly unusable: number }>;
}

/**
 * Samples the Gaussians once runs have stopped. Reports a run whose rows are all unusable once, because nothing is
 * visible although nothing has failed; and again after a usable one. Transparent Gaussians are not reported, because
 * scenes fade in.
 */
export class RunWatch {
  readonly #gaussians: Watched;
  readonly #where: string;
  readonly #onError: (error: unknown) => void;
  readonly #onBounds: (bounds: Bounds, isFirst: boolean) => void;
  #timer: ReturnType<typeof setTimeout> | undefined;
  #isEmpty = false;

  /** @param onBounds Is called with the bounds, and whether the previous sample had no usable rows. */
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

  /** Call when a run is shown. Returns at once. */
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
    // A closed scene reports nothing.
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
      found: `a run in which none can: ${unusable} rows have numbers that are not finite, no extent, or a rotation of zeros`,
      remedy: 'look for a division by zero: "gaussian-splat check MODEL --run" says at which inputs',
    },
  ]);
