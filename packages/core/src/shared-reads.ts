/** Bytes of what was read that are kept, by default. */
const KEPT_BYTES = 128e6;

interface Reading<T> {
  readonly result: Promise<T>;
  readonly controller: AbortController;
  readonly owner: unknown;
  readers: number;
  /** Bytes, once it is there. */
  bytes?: number;
}

/**
 * What several callers need at once, or one after the other: it is read for the first of them, for as long as one waits, and what was used last is kept, up to a number of
 * bytes.
 */
export class SharedReads<T> {
  readonly #sizeOf: (result: T) => number;
  readonly #keptBytes: number;
  /** The one used last is the last. */
  readonly #readings = new Map<string, Reading<T>>();

  /**
   * @param sizeOf bytes that a result takes
   * @param keptBytes results that are kept; the last one is, however large
   */
  constructor(sizeOf: (result: T) => number, keptBytes = KEPT_BYTES) {
    this.#sizeOf = sizeOf;
    this.#keptBytes = keptBytes;
  }

  /** Whether a result is kept. */
  has(key: string): boolean {
    return this.#readings.get(key)?.bytes !== undefined;
  }

  /**
   * Rejects as `read` does, or with the reason of `signal` as soon as that is aborted.
   * @param read is aborted when no caller waits for it any more
   * @param owner on whose account it is read: results are shared by all, readings under way by those of one account
   */
  async read(
    key: string,
    read: (signal: AbortSignal) => Promise<T>,
    signal?: AbortSignal,
    owner?: unknown,
  ): Promise<T> {
    signal?.throwIfAborted();
    const known = this.#readings.get(key);
    const isShared = known !== undefined && (known.bytes !== undefined || known.owner === owner);
    const reading = isShared ? known : this.#start(key, read, owner);
    this.#readings.delete(key);
    this.#readings.set(key, reading);
    reading.readers++;
    let giveUp: (() => void) | undefined;
    const givenUp = new Promise<never>((_, reject) => {
      giveUp = () => reject(signal?.reason);
      signal?.addEventListener('abort', giveUp, { once: true });
    });
    try {
      return await Promise.race([reading.result, givenUp]);
    } finally {
      signal?.removeEventListener('abort', giveUp!);
      if (--reading.readers === 0 && reading.bytes === undefined) this.#end(key, reading);
    }
  }

  #start(key: string, read: (signal: AbortSignal) => Promise<T>, owner: unknown): Reading<T> {
    const controller = new AbortController();
    const reading: Reading<T> = { result: read(controller.signal), controller, owner, readers: 0 };
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
      if (all <= this.#keptBytes) return;
      this.#readings.delete(key);
      all -= bytes!;
    }
  }
}
