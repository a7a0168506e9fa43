import type { Bounds } from '@gaussian-splat/core';
import { ContractError } from '@gaussian-splat/core/contract';

/** After the last run, ms: a look reads all places back, and while runs follow one another there is none. */
const REST_MS = 700;
/** Gaussians up to which there is a look. */
const MOST = 1_000_000;

/** What a look needs: `DynamicGaussians` of the renderer. */
export interface Watched {
  readonly count: number;
  readSample(): Promise<{ readonly bounds: Bounds; readonly drawn: number; readonly unusable: number }>;
}

/**
 * Looks at the Gaussians once runs have come to rest. Reports once a run whose rows cannot be drawn, for then nothing is seen and nothing has failed; and
 * again after one that could be. Gaussians without opacity are none of that: scenes fade in.
 */
export class RunWatch {
  readonly #gaussians: Watched;
  readonly #where: string;
  readonly #onError: (error: unknown) => void;
  readonly #onBounds: (bounds: Bounds, isFirst: boolean) => void;
  #timer: ReturnType<typeof setTimeout> | undefined;
  #isEmpty = false;

  /** @param onBounds gets where they are, and whether none could be drawn at the look before */
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

  /** A run is on show. Returns at once. */
  frameMade(): void {
    clearTimeout(this.#timer);
    if (this.#gaussians.count > MOST) return;
    this.#timer = setTimeout(() => void this.#look(), REST_MS);
  }

  close(): void {
    clearTimeout(this.#timer);
  }

  async #look(): Promise<void> {
    const sample = await this.#gaussians.readSample().catch(() => undefined);
    // A scene that was closed meanwhile has nothing to tell.
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
