import { GaussianSplatError } from '@gaussian-splat/core';
import { partUrl } from '@gaussian-splat/core/fetch';
import { refuse, type LoadLimits } from './budget.js';
import { quote } from './bytes.js';
import { Download } from './download.js';
import { label } from './network-errors.js';
import { outOfMemory } from './scene-errors.js';
import type { OpenFile } from './scene-format.js';

/** `maxBytes` and `maxSeconds` end the download with `out-of-memory/budget`. */
export interface FetchSceneOptions extends Pick<LoadLimits, 'maxBytes' | 'maxSeconds'> {
  /** `cors` (default) or `same-origin`; responses to `no-cors` requests cannot be read. */
  readonly mode?: 'cors' | 'same-origin';
  /** Cookies policy; default `same-origin`. */
  readonly credentials?: RequestCredentials;
  /** Aborts the download; the promise then rejects with the signal's reason. */
  readonly signal?: AbortSignal;
  /**
   * Called after every chunk with the number of received bytes. The total is undefined if the server does not declare
   * it or declares the length of a compressed transfer.
   */
  readonly onProgress?: (loadedBytes: number, totalBytes: number | undefined) => void;
  /**
   * Called after every chunk with all received bytes, which never change, and the total as above. The download
   * continues when the promise resolves. If a server cannot resume an interrupted download, these bytes start again.
   */
  readonly onArrival?: (bytes: Uint8Array, totalBytes: number | undefined) => void | Promise<void>;
  /**
   * Maximum number of consecutive resumptions of an interrupted download without progress of 64 KiB; it continues at
   * the same byte if the server supports that. Default 3.
   */
  readonly retries?: number;
}

/** Pause before the first resumption, ms; it doubles each time. */
const RETRY_DELAY_MS = 250;
/** Minimum progress in bytes, so that a file is not loaded with a connection for each byte. */
const MIN_PROGRESS = 65_536;

/**
 * Downloads a file with exact progress. A connection that is interrupted, or that transfers less than 1 KiB in 30 s, is
 * resumed at the same byte by a range request, if a validator (ETag, Last-Modified) shows that the file is unchanged;
 * otherwise the whole file is requested again. A temporarily unavailable server (429, 503; also 5xx after the first
 * bytes) is retried after a pause; one that does not respond within 30 s is abandoned.
 *
 * @param url Absolute, or relative to the page or worker script (a worker created from a blob has no base address:
 * resolve the URL before).
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
  /** Waits before a retry; throws the error once the retries are used up. */
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
      const { length } = download.bytes;
      if (length >= farthest + MIN_PROGRESS) [tries, farthest] = [0, length];
      // Any further error is reported as the interrupted connection.
      do await pause(error);
      while (!(await download.resume()));
    }
  }
}

function parseUrl(url: string | URL): URL {
  const base = globalThis.location?.href;
  const refuse = (shown: string, found: string, cause?: unknown): never => {
    throw new GaussianSplatError('network/url', {
      where: `address ${quote(shown, 200)}`,
      // In a worker the base is the worker's script, which is meaningless to the user.
      expected: base ? 'an absolute URL or a relative one' : 'an absolute URL',
      found,
      remedy: 'correct the address of the scene',
      cause,
    });
  };
  let address: URL;
  try {
    address = new URL(url, base);
  } catch (cause) {
    return refuse(String(url), 'text that is none', cause);
  }
  // Browsers reject such requests with messages that repeat the password.
  const { username, password, host, pathname } = address;
  return username || password
    ? refuse(host + pathname, 'one with a user name or password, which browsers refuse')
    : address;
}

/** Waits; rejects with the reason of the signal. */
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
 * Returns an opener for the other files of a scene, for `ReadSceneOptions.openFile`: each is fetched relative to the
 * scene with the same options, and with the scene's query unless it has its own.
 *
 * @param url Absolute address of the scene's own file.
 * @param optionsOf Options for each file, by its path.
 */
export function fileOpenerFor(url: string | URL, optionsOf: (path: string) => FetchSceneOptions): OpenFile {
  return (path, query) => fetchScene(partAddress(url, path, query), optionsOf(path));
}

/**
 * Returns the address of another file of a scene. Every segment of the path is encoded, so that it cannot address
 * another server.
 */
export function partAddress(url: string | URL, path: string, query = ''): URL {
  // Two slashes would start a server name.
  const encoded = path
    .replace(/^\/+/, '/')
    .split('/')
    .map((part) => (part === '..' || part === '.' ? part : encodeURIComponent(part)));
  return partUrl(encoded.join('/') + query, url);
}
