import { GaussianSplatError } from '@gaussian-splat/core';
import type { ProgressListener } from '../../loading/protocol.js';

/** Fetches a file. Rejects with GaussianSplatError, or with the signal's reason. */
type Fetch = (url: string, signal: AbortSignal, onProgress: ProgressListener) => Promise<ArrayBuffer>;

/** A file on its way. */
interface Download {
  readonly url: string;
  readonly controller: AbortController;
  /** Resolves with undefined if the download fails or is stopped. */
  readonly whole: Promise<File | undefined>;
  onProgress?: ProgressListener;
}

/** Maximum size of the files that are kept, bytes. */
const MAX_BYTES = 64e6;

/** Files that are fetched before they are needed, one after the other. */
export class Ahead {
  readonly #files = new Map<string, File>();
  /** Files that failed, or for which there was no room beside others that are wanted. */
  readonly #skipped = new Set<string>();
  readonly #warn: (error: Error) => void;
  #wanted: readonly string[] = [];
  #download: Download | undefined;

  constructor(warn: (error: Error) => void) {
    this.#warn = warn;
  }

  /** Fetches the files that may be needed next. One that is on its way stays so. */
  want(urls: readonly string[], fetch: Fetch): void {
    if (urls.join() !== this.#wanted.join()) this.#skipped.clear();
    this.#wanted = urls;
    if (this.#download && urls.includes(this.#download.url)) return;
    this.stop();
    const url = urls.find((each) => !this.#files.has(each) && !this.#skipped.has(each));
    if (url === undefined) return;
    const controller = new AbortController();
    const { signal } = controller;
    const report: ProgressListener = (...progress) => download.onProgress?.(...progress);
    const bytes = Promise.resolve().then(() => fetch(url, signal, report));
    const whole = bytes.then(
      (content) => this.#keep(url, content),
      (error: unknown) => {
        if (!signal.aborted) this.#fail(url, error as Error);
        return undefined;
      },
    );
    const download: Download = { url, controller, whole };
    this.#download = download;
    void whole.then(() => {
      if (this.#download !== download) return;
      this.#download = undefined;
      if (this.#wanted === urls) this.want(urls, fetch);
    });
  }

  /** Whether a file is on its way. */
  isFetching(url: string): boolean {
    return this.#download?.url === url;
  }

  /** Returns a file that was fetched, after the rest of it has arrived; undefined for others. Nothing else is fetched meanwhile. */
  async take(url: string, onProgress: ProgressListener): Promise<File | undefined> {
    this.#wanted = [];
    if (!this.isFetching(url)) this.stop();
    if (!this.#download) return this.#files.get(url);
    this.#download.onProgress = onProgress;
    return this.#download.whole;
  }

  forget(url: string): void {
    this.#files.delete(url);
  }

  /** Stops the download that is on its way. */
  stop(): void {
    this.#download?.controller.abort();
    this.#download = undefined;
  }

  /** Keeps a file, and forgets those that were fetched first while all together are too large. */
  #keep(url: string, content: ArrayBuffer): File {
    const file = new File([content], new URL(url).pathname.split('/').at(-1)!);
    this.#files.set(url, file);
    const sizeOf = (): number => [...this.#files.values()].reduce((sum, { size }) => sum + size, 0);
    for (const first of this.#files.keys()) {
      if (this.#files.size === 1 || sizeOf() <= MAX_BYTES) break;
      this.#skipped.add(first);
      this.#files.delete(first);
    }
    return file;
  }

  #fail(url: string, error: Error): void {
    this.#skipped.add(url);
    if (error instanceof GaussianSplatError) this.#warn(error);
    else console.error(error);
  }
}
