/**
 * Work of which only the latest request counts: whatever asks anew ends what was asked for before. What is ended finds its signal aborted, does nothing more, and what it fails with
 * then is nobody's concern.
 */
export class LatestTask {
  #running = new AbortController();

  /** Of the request that counts. */
  get signal(): AbortSignal {
    return this.#running.signal;
  }

  /** Ends what runs. @returns the signal of what comes after */
  renew(): AbortSignal {
    this.#running.abort();
    this.#running = new AbortController();
    return this.signal;
  }

  /** Ends what runs and does this instead; `failed` hears why it could not be done, unless another request has come meanwhile. */
  run(work: (signal: AbortSignal) => Promise<void>, failed: (error: unknown) => void): void {
    const signal = this.renew();
    work(signal).catch((error: unknown) => {
      if (!signal.aborted) failed(error);
    });
  }
}
