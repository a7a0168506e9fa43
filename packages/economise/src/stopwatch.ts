/** Where the time goes. */
export class Stopwatch {
  readonly #seconds: Record<string, number> = {};
  #last = performance.now();

  /** Adds what has passed since the last lap to a kind of work. */
  lap(work: string): void {
    const now = performance.now();
    this.#seconds[work] = (this.#seconds[work] ?? 0) + (now - this.#last) / 1000;
    this.#last = now;
  }

  /** By the kind of work, s. */
  get seconds(): Readonly<Record<string, number>> {
    return { ...this.#seconds };
  }
}
