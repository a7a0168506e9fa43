export interface BackOffOptions {
  /** Milliseconds of the pause after the first failure. */
  readonly firstMs: number;
  /** Factor from each pause to the next. */
  readonly factor: number;
  /** Number of consecutive failures after which no more attempts follow. */
  readonly maxTries: number;
  /** Returns the current time in milliseconds, from any origin. Default: `performance.now`. */
  readonly now?: (() => number) | undefined;
}

/** Counts the consecutive failures of each key, and delays its next attempt by a pause that grows with them. */
export class BackOff<K> {
  readonly #options: BackOffOptions;
  readonly #failures = new Map<K, { times: number; until: number; isTaken: boolean }>();

  constructor(options: BackOffOptions) {
    this.#options = options;
  }

  /** Records a failure of a key, and starts its pause. Returns the number of its consecutive failures. */
  fail(key: K): number {
    const { firstMs, factor, maxTries } = this.#options;
    const times = (this.#failures.get(key)?.times ?? 0) + 1;
    const pause = times < maxTries ? firstMs * factor ** (times - 1) : Infinity;
    this.#failures.set(key, { times, until: this.#now() + pause, isTaken: false });
    return times;
  }

  succeed(key: K): void {
    this.#failures.delete(key);
  }

  /** Whether the pause of a key has not ended; true forever after `maxTries` consecutive failures. */
  isPaused(key: K): boolean {
    return this.#now() < (this.#failures.get(key)?.until ?? -Infinity);
  }

  /** Returns the keys whose pause has ended since the last call. `isMore`: whether pauses of other keys will end. */
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
