interface Entry {
  readonly bytes: Promise<ArrayBuffer>;
  readonly controller: AbortController;
  /** Who waits for it. */
  waiting: number;
  /** Bytes; undefined until it has come. */
  size?: number;
}

/** Files that hold several pages: each is fetched once for all that ask for it meanwhile, and those used last are kept. */
export class PageFiles {
  readonly #fetch: (file: string, signal: AbortSignal) => Promise<ArrayBuffer>;
  readonly #most: number;
  /** Those used last at the end. */
  readonly #entries = new Map<string, Entry>();
  #kept = 0;

  /**
   * @param fetch brings a file; aborted when nobody waits for it any more
   * @param most bytes of files that are kept; the last one is, whatever its size
   */
  constructor(fetch: (file: string, signal: AbortSignal) => Promise<ArrayBuffer>, most: number) {
    this.#fetch = fetch;
    this.#most = most;
  }

  /** The bytes of a file, which belong to all who asked for it. Rejects with what the fetch threw. */
  async get(file: string, signal: AbortSignal): Promise<ArrayBuffer> {
    const entry = this.#entries.get(file) ?? this.#begin(file);
    this.#entries.delete(file);
    this.#entries.set(file, entry);
    if (entry.size !== undefined) return entry.bytes;
    entry.waiting++;
    const leave = (): void => {
      if (--entry.waiting > 0 || entry.size !== undefined) return;
      this.#forget(file, entry);
      entry.controller.abort();
    };
    signal.addEventListener('abort', leave, { once: true });
    try {
      return await entry.bytes;
    } finally {
      signal.removeEventListener('abort', leave);
    }
  }

  /** True for a file that is kept. */
  has(file: string): boolean {
    return this.#entries.get(file)?.size !== undefined;
  }

  #begin(file: string): Entry {
    const controller = new AbortController();
    const entry: Entry = { bytes: this.#fetch(file, controller.signal), controller, waiting: 0 };
    entry.bytes.then(
      ({ byteLength }) => this.#keep(file, entry, byteLength),
      () => this.#forget(file, entry),
    );
    return entry;
  }

  #keep(file: string, entry: Entry, size: number): void {
    if (this.#entries.get(file) !== entry) return;
    entry.size = size;
    this.#kept += size;
    for (const [name, oldest] of this.#entries) {
      if (this.#kept <= this.#most) return;
      if (oldest.size === undefined || oldest === entry) continue;
      this.#entries.delete(name);
      this.#kept -= oldest.size;
    }
  }

  #forget(file: string, entry: Entry): void {
    if (this.#entries.get(file) === entry) this.#entries.delete(file);
  }
}
