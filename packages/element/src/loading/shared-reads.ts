/** Bytes of what was read that are kept; what was read last is, however large. */
const KEPT_BYTES = 128e6;

interface Reading<T> {
  readonly result: Promise<T>;
  readonly controller: AbortController;
  readers: number;
  /** Bytes, once it is there. */
  bytes?: number;
}

/** What several requests need at once, or one after the other: it is read for the first of them, and for as long as one waits. */
export class SharedReads<T> {
  readonly #sizeOf: (result: T) => number;
  /** The one used last is the last. */
  readonly #readings = new Map<string, Reading<T>>();

  /** @param sizeOf bytes that a result takes */
  constructor(sizeOf: (result: T) => number) {
    this.#sizeOf = sizeOf;
  }

  /** Rejects as `read` does, or with the reason of `signal` as soon as that is aborted. */
  async read(key: string, read: (signal: AbortSignal) => Promise<T>, signal: AbortSignal): Promise<T> {
    signal.throwIfAborted();
    const reading = this.#readings.get(key) ?? this.#start(key, read);
    this.#readings.delete(key);
    this.#readings.set(key, reading);
    reading.readers++;
    let giveUp: (() => void) | undefined;
    const givenUp = new Promise<never>((_, reject) => {
      giveUp = () => reject(signal.reason);
      signal.addEventListener('abort', giveUp, { once: true });
    });
    try {
      return await Promise.race([reading.result, givenUp]);
    } finally {
      signal.removeEventListener('abort', giveUp!);
      if (--reading.readers === 0 && reading.bytes === undefined) this.#end(key, reading);
    }
  }

  #start(key: string, read: (signal: AbortSignal) => Promise<T>): Reading<T> {
    const controller = new AbortController();
    const reading: Reading<T> = { result: read(controller.signal), controller, readers: 0 };
    reading.result.then(
      (result) => {
        reading.bytes = this.#sizeOf(result);
        this.#forgetOld();
      },
      () => this.#end(key, reading),
    );
    return reading;
  }

  #end(key: string, reading: Reading<T>): void {
    if (this.#readings.get(key) === reading) this.#readings.delete(key);
    reading.controller.abort();
  }

  #forgetOld(): void {
    const done = [...this.#readings].filter(([, { bytes }]) => bytes !== undefined);
    let all = done.reduce((sum, [, { bytes }]) => sum + bytes!, 0);
    for (const [key, { bytes }] of done.slice(0, -1)) {
      if (all <= KEPT_BYTES) return;
      this.#readings.delete(key);
      all -= bytes!;
    }
  }
}
