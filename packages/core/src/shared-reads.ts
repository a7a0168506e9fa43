/** Default limit of cached results in bytes. */
const KEPT_BYTES = 128e6;

interface Reading<T> {
  readonly result: Promise<T>;
  readonly controller: AbortController;
  readonly owner: unknown;
  readers: number;
  /** Size of the result in bytes; undefined while the read is pending. */
  bytes?: number;
}

/**
 * Shares reads between concurrent and subsequent callers. A read continues while any caller waits for it. Recently used
 * results are cached up to a number of bytes.
 */
export class SharedReads<T> {
  readonly #sizeOf: (result: T) => number;
  readonly #keptBytes: number;
  /** Reads by key; the most recently used one is last. */
  readonly #readings = new Map<string, Reading<T>>();

  /**
   * @param sizeOf Returns the size of a result in bytes.
   * @param keptBytes Maximum size of the cache in bytes. The last result is always kept.
   */
  constructor(sizeOf: (result: T) => number, keptBytes = KEPT_BYTES) {
    this.#sizeOf = sizeOf;
    this.#keptBytes = keptBytes;
  }

  /** Whether the result of a key is cached. */
  has(key: string): boolean {
    return this.#readings.get(key)?.bytes !== undefined;
  }

  /**
   * Returns the result of a key from the cache, from a pending read, or from a new read. Rejects as `read` does, or at
   * once with the reason of `signal` when that aborts.
   * @param read Reads the result; its signal aborts when no caller waits any more.
   * @param owner Account of the caller. All callers share results; callers of one account share pending reads.
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
