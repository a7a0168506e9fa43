/**
 * Runs one task at a time: a new task aborts the previous one. An aborted task must stop, and its errors are ignored.
 */
export class LatestTask {
  #running = new AbortController();

  /** Signal of the current task. */
  get signal(): AbortSignal {
    return this.#running.signal;
  }

  /** Aborts the current task. @returns The signal of the next task. */
  renew(): AbortSignal {
    this.#running.abort();
    this.#running = new AbortController();
    return this.signal;
  }

  /**
   * Aborts the current task and runs `work`. Calls `failed` with the error of `work`, unless another task has started
   * meanwhile.
   */
  run(work: (signal: AbortSignal) => Promise<void>, failed: (error: unknown) => void): void {
    const signal = this.renew();
    work(signal).catch((error: unknown) => {
      if (!signal.aborted) failed(error);
    });
  }
}
