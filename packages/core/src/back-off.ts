export interface BackOffOptions {
  /** Milliseconds of the pause after the first failure. */
  readonly firstMs: number;
  /** How many times as long each further pause is. */
  readonly factor: number;
  /** Failures in a row after which there is no other try. */
  readonly mostTries: number;
  /** Milliseconds since any moment. Default: `performance.now`. */
  readonly now?: (() => number) | undefined;
}

/** Of what has failed: how often in a row, and when it may be tried again. */
export class BackOff<K> {
  readonly #options: BackOffOptions;
  readonly #failures = new Map<K, { times: number; until: number; isTaken: boolean }>();

  constructor(options: BackOffOptions) {
    this.#options = options;
  }

  /** @returns how often it has failed in a row */
  fail(key: K): number {
    const { firstMs, factor, mostTries } = this.#options;
    const times = (this.#failures.get(key)?.times ?? 0) + 1;
    const pause = times < mostTries ? firstMs * factor ** (times - 1) : Infinity;
    this.#failures.set(key, { times, until: this.#now() + pause, isTaken: false });
    return times;
  }

  succeed(key: K): void {
    this.#failures.delete(key);
  }

  /** Whether it is not to be tried now. */
  isPaused(key: K): boolean {
    return this.#now() < (this.#failures.get(key)?.until ?? -Infinity);
  }

  /** Those whose pause has ended since the last call. @returns them, and whether the pause of others will end */
  takeDue(): { readonly due: K[]; readonly isMore: boolean } {
    const due: K[] = [];
    let isMore = false;
    for (const [key, failure] of this.#failures) {
      if (failure.isTaken || failure.until === Infinity) continue;
      if (this.isPaused(key)) isMore = true;
      else {
        failure.isTaken = true;
        due.push(key);
      }
    }
    return { due, isMore };
  }

  #now(): number {
    return this.#options.now?.() ?? performance.now();
  }
}
