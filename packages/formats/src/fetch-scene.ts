import { GaussianSplatError } from '@gaussian-splat/core';
import { label, parseUrl, partUrl } from '@gaussian-splat/core/fetch';
import { refuse, type LoadLimits } from './budget.js';
import { Download } from './download.js';
import { outOfMemory } from './scene-errors.js';
import type { OpenFile } from './scene-format.js';

/** Options of {@link fetchScene}. A download that exceeds `maxBytes` or `maxSeconds` fails: `out-of-memory/budget`. */
export interface FetchSceneOptions extends Pick<LoadLimits, 'maxBytes' | 'maxSeconds'> {
  /** Mode of the request: `cors` (default) or `same-origin`. Scripts cannot read responses to `no-cors` requests. */
  readonly mode?: 'cors' | 'same-origin';
  /** Whether the request sends cookies; default `same-origin`. */
  readonly credentials?: RequestCredentials;
  /** Aborts the download; the promise then rejects with the signal's reason. */
  readonly signal?: AbortSignal;
  /**
   * Called after every chunk with the number of received bytes and the total. The total is undefined if the server does
   * not declare it, or declares the length of a compressed transfer.
   */
  readonly onProgress?: (loadedBytes: number, totalBytes: number | undefined) => void;
  /**
   * Called after every chunk with all received bytes, and the total as in `onProgress`. Later chunks do not change these
   * bytes. The download continues when the promise resolves. If the whole file is requested again after an interruption,
   * `bytes` starts again from the first byte. If the promise resolves to true, the bytes are not kept: `bytes` of the next
   * call begins at offset `first` of the file, and the result of {@link fetchScene} has only the last bytes.
   */
  readonly onArrival?: (
    bytes: Uint8Array,
    totalBytes: number | undefined,
    first: number,
  ) => void | boolean | Promise<void | boolean>;
  /**
   * Maximum number of consecutive retries without progress of 64 KiB. A retry continues at the same byte if the server
   * supports range requests. Default 3.
   */
  readonly retries?: number;
}

/** Milliseconds before the first retry; each further delay is twice as long. */
const RETRY_DELAY_MS = 250;
/** Progress in bytes that resets the number of retries. Without it, each byte could take another connection. */
const MIN_PROGRESS = 65_536;

/**
 * Downloads a file with exact progress. A connection that is interrupted, or that transfers less than 1 KiB in 30 s, is
 * resumed at the same byte by a range request, if a validator (ETag, Last-Modified) shows that the file is unchanged;
 * otherwise the whole file is requested again. A temporarily unavailable server (429, 503; also 5xx after the first
 * bytes) is retried after a pause; one that does not respond within 30 s is abandoned.
 *
 * @param url Absolute URL, or relative to the page or the worker's script. A worker created from a blob has no base URL,
 * and requires an absolute one.
 * @returns The whole file.
 * @throws GaussianSplatError `network/url`, `network/unreachable` (no server, offline, CORS, mixed content),
 * `network/status`, `network/interrupted`, `out-of-memory/budget` or `out-of-memory/allocation`; the reason of
 * `signal`, usually a DOMException named AbortError.
 */
export async function fetchScene(url: string | URL, options: FetchSceneOptions = {}): Promise<Uint8Array> {
  const address = parseUrl(url);
  const { signal, maxSeconds = Infinity } = options;
  // Timers are limited to 2^31 ms.
  const limit = maxSeconds < 2e6 ? AbortSignal.timeout(1000 * Math.max(0, maxSeconds)) : undefined;
  const signals = [signal, limit].filter((each) => each !== undefined);
  const either = signals.length > 1 ? AbortSignal.any(signals) : signals[0];
  try {
    return await bring(new Download(address, { ...options, signal: either }), either, options.retries);
  } catch (error) {
    signal?.throwIfAborted();
    if (limit?.aborted) refuse(label(address), `at most ${maxSeconds} s`, 'more', error);
    throw outOfMemory(error, label(address)) ?? error;
  }
}

async function bring(download: Download, signal: AbortSignal | undefined, retries = 3): Promise<Uint8Array> {
  let [tries, farthest] = [0, 0];
  /** Waits before a retry. Throws `error` instead if no retries are left. */
  const pause = async (error: unknown): Promise<void> => {
    if (tries >= retries) throw error;
    await delay(RETRY_DELAY_MS * 2 ** tries++, signal);
  };
  for (let busy = await download.start(); busy; busy = await download.start()) await pause(busy);
  for (;;) {
    try {
      await download.read();
      return download.bytes;
    } catch (error) {
      signal?.throwIfAborted();
      if (!(error instanceof GaussianSplatError) || error.code !== 'network/interrupted') throw error;
      const { length } = download;
      if (length >= farthest + MIN_PROGRESS) [tries, farthest] = [0, length];
      // Any further error is reported as the interrupted connection.
      do await pause(error);
      while (!(await download.resume()));
    }
  }
}

/** Returns a promise that resolves after `ms` milliseconds, or rejects with the signal's reason when it aborts. */
function delay(ms: number, signal: AbortSignal | undefined): Promise<void> {
  return new Promise((resolve, reject) => {
    const give = (): void => {
      clearTimeout(timer);
      reject(signal?.reason);
    };
    const timer = setTimeout(() => {
      signal?.removeEventListener('abort', give);
      resolve();
    }, ms);
    signal?.addEventListener('abort', give, { once: true });
  });
}

/**
 * Returns a function for `ReadSceneOptions.openFile`, which downloads the other files of a scene. It resolves each path
 * relative to the scene's URL, and adds the scene's query to files without a query.
 *
 * @param url Absolute URL of the scene's own file.
 * @param optionsOf Returns the download options of a file with the given path.
 */
export function fileOpenerFor(url: string | URL, optionsOf: (path: string) => FetchSceneOptions): OpenFile {
  return (path, query) => fetchScene(partAddress(url, path, query), optionsOf(path));
}

/**
 * Returns the URL of another file of a scene. Every segment of the path is encoded, so that a path cannot address
 * another server.
 * @param url Absolute URL of the scene's own file.
 * @param query Query of the file with its `?`; if empty, the scene's query applies.
 */
export function partAddress(url: string | URL, path: string, query = ''): URL {
  // A URL that begins with two slashes would name another server.
  const encoded = path
    .replace(/^\/+/, '/')
    .split('/')
    .map((part) => (part === '..' || part === '.' ? part : encodeURIComponent(part)));
  return partUrl(encoded.join('/') + query, url);
}
