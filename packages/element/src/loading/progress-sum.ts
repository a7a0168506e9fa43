import type { ProgressListener } from './protocol.js';

/** Adds up the received and the total bytes of all files of one scene. */
export class ProgressSum {
  readonly #onProgress: ProgressListener;
  readonly #files: { loaded: number; total: number | undefined }[] = [];
  /** Minimum number of files for a known total. With fewer files it is reported as undefined. */
  readonly #min: number;

  /** @param hasParts Whether the first file names other files, whose bytes count. */
  constructor(onProgress: ProgressListener, hasParts: boolean) {
    this.#onProgress = onProgress;
    this.#min = hasParts ? 2 : 1;
  }

  /** Adds another file; returns the listener of its download. */
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
    let total: number | undefined = this.#files.length < this.#min ? undefined : 0;
    for (const file of this.#files) {
      loaded += file.loaded;
      total = total === undefined || file.total === undefined ? undefined : total + file.total;
    }
    this.#onProgress(loaded, total);
  }
}
