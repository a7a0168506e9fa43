import type { Bounds } from '@gaussian-splat/core';
import { ContractError } from '@gaussian-splat/core/contract';

/** After the last run, ms: a look reads all places back, and while runs follow one another there is none. */
const REST_MS = 700;
/** Gaussians up to which there is a look. */
const MOST = 1_000_000;

/** What a look needs: `DynamicGaussians` of the renderer. */
export interface Watched {
  readonly count: number;
  readBounds(): Promise<Bounds>;
}

/**
 * Looks at where Gaussians are once runs have come to rest. Says once that what a generator writes cannot be drawn at all, for then nothing is seen and nothing
 * has failed; and again after it could.
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
    const bounds = await this.#gaussians.readBounds().catch(() => undefined);
    // A scene that was closed meanwhile has nothing to tell.
    if (bounds === undefined) return;
    // Rows that cannot be drawn are at the origin; one Gaussian alone may be there by right.
    const isEmpty = this.#gaussians.count > 1 && [...bounds.min, ...bounds.max].every((side) => side === 0);
    if (isEmpty && !this.#isEmpty) this.#onError(unusable(this.#where));
    if (!isEmpty) this.#onBounds(bounds, this.#isEmpty);
    this.#isEmpty = isEmpty;
  }
}

const unusable = (where: string): ContractError =>
  new ContractError([
    {
      code: 'contract/not-finite',
      where,
      expected: 'Gaussians that can be drawn',
      found: 'a run in which none can: all have numbers that are not finite, or no opacity',
      remedy: 'npm run gaussian-splat -- check MODEL --run says at which inputs; look there for a division by zero',
    },
  ]);
