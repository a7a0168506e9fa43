import type { ProgressListener } from './protocol.js';

/** Adds up the progress of the files of one scene. */
export class ProgressSum {
  readonly #onProgress: ProgressListener;
  readonly #files: { loaded: number; total: number | undefined }[] = [];
  /** Files that there are at least: until then the total is not known. */
  readonly #least: number;

  /** @param hasParts true if the first file names others, whose lengths count. */
  constructor(onProgress: ProgressListener, hasParts: boolean) {
    this.#onProgress = onProgress;
    this.#least = hasParts ? 2 : 1;
  }

  /** Begins another file; returns what its download calls. */
  add(): ProgressListener {
    const file = { loaded: 0, total: undefined as number | undefined };
    this.#files.push(file);
    return (loaded, total) => {
      [file.loaded, file.total] = [loaded, total];
      this.#report();
    };
  }

  #report(): void {
    let loaded = 0;
    let total: number | undefined = this.#files.length < this.#least ? undefined : 0;
    for (const file of this.#files) {
      loaded += file.loaded;
      total = total === undefined || file.total === undefined ? undefined : total + file.total;
    }
    this.#onProgress(loaded, total);
  }
}
