/** Default limit of cached results in bytes. */
const KEPT_BYTES = 128e6;

interface Reading<T> {
  readonly result: Promise<T>;
  readonly controller: AbortController;
  readonly owner: unknown;
  readers: number;
  /** Size in bytes, once it is loaded. */
  bytes?: number;
}

/**
 * Shares reads between callers, concurrent or subsequent: a read continues while any caller waits, and recently used
 * results are cached up to a number of bytes.
 */
export class SharedReads<T> {
  readonly #sizeOf: (result: T) => number;
  readonly #keptBytes: number;
  /** The most recently used is last. */
  readonly #readings = new Map<string, Reading<T>>();

  /**
   * @param sizeOf Size of a result in bytes.
   * @param keptBytes Limit of the cache; the last result is always kept.
   */
  constructor(sizeOf: (result: T) => number, keptBytes = KEPT_BYTES) {
    this.#sizeOf = sizeOf;
    this.#keptBytes = keptBytes;
  }

  /** Whether a result is cached. */
  has(key: string): boolean {
    return this.#readings.get(key)?.bytes !== undefined;
  }

  /**
   * Rejects as `read` does, or immediately with the reason of `signal` when it is aborted.
   * @param read Is aborted when no caller waits for it.
   * @param owner Account of the read: results are shared by all callers, pending reads by those of one account.
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
