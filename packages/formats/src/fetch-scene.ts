import { GaussianSplatError } from '@gaussian-splat/core';
import { partUrl } from '@gaussian-splat/core/fetch';
import { refuse, type LoadLimits } from './budget.js';
import { quote } from './bytes.js';
import { Download } from './download.js';
import { label } from './network-errors.js';
import { outOfMemory } from './scene-errors.js';
import type { OpenPart } from './scene-format.js';

/** `maxBytes` and `maxSeconds` end the download with `out-of-memory/budget`. */
export interface FetchSceneOptions extends Pick<LoadLimits, 'maxBytes' | 'maxSeconds'> {
  /** `cors` (default) or `same-origin`; answers to `no-cors` requests cannot be read. */
  readonly mode?: 'cors' | 'same-origin';
  /** Which cookies are sent; default `same-origin`. */
  readonly credentials?: RequestCredentials;
  /** Aborts the download; the promise then rejects with the signal's reason. */
  readonly signal?: AbortSignal;
  /**
   * Called after every chunk with the bytes until now. The total is undefined where the server does not say it or says
   * the length of a compressed transfer, which is another number than that of the bytes that arrive.
   */
  readonly onProgress?: (loadedBytes: number, totalBytes: number | undefined) => void;
  /**
   * Called after every chunk with all bytes until now, which stay as they are, and the total as above. The download goes on when the
   * promise fulfils. A server that cannot go on where a connection broke begins again, and so do these bytes.
   */
  readonly onArrival?: (bytes: Uint8Array, totalBytes: number | undefined) => void | Promise<void>;
  /** How often in a row, without getting farther by 64 KiB, a download that broke off is taken up again, where it stopped if the server can do that; default 3. */
  readonly retries?: number;
}

/** Pause before a download is taken up again the first time, ms; it doubles each time. */
const RETRY_DELAY_MS = 250;
/** Bytes by which a download has got farther: a connection for each byte is no way to load a file. */
const LEAST_PROGRESS = 65_536;

/**
 * Downloads a file with true progress. A connection that breaks off, or on which less than 1 KiB comes in 30 s, is taken up again where it stopped, by a range request, if the server tells
 * (ETag, Last-Modified) that the file is still the same; otherwise all of it is asked for again. A server that has no time (429, 503; 5xx once it had begun) is asked again after a while, one
 * that does not answer within 30 s is given up.
 *
 * @param url absolute, or relative to the page or worker script (which in a worker made from a blob has no address:
 * resolve the URL before).
 * @throws GaussianSplatError `network/url`, `network/unreachable` (no server, offline, CORS, mixed content),
 * `network/status`, `network/interrupted`, `out-of-memory/budget` or `out-of-memory/allocation`; the reason of `signal`, usually a DOMException named AbortError.
 */
export async function fetchScene(url: string | URL, options: FetchSceneOptions = {}): Promise<Uint8Array> {
  const address = parseUrl(url);
  const { signal, maxSeconds = Infinity } = options;
  // Timers end at 2^31 ms.
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
  /** Waits before another try; throws what went wrong once there have been enough. */
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
      if (length >= farthest + LEAST_PROGRESS) [tries, farthest] = [0, length];
      // Whatever goes wrong now, what is to be told is that the connection broke.
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
      // In a worker the base is that of the worker's script, which nobody who reads this has written.
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
  // Browsers refuse such requests in words that repeat the password.
  const { username, password, host, pathname } = address;
  return username || password
    ? refuse(host + pathname, 'one with a user name or password, which browsers refuse')
    : address;
}

/** Waits, or rejects with the signal's reason. */
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
 * A way to the other files of the scene at an address, for `ReadSceneOptions.openPart`: each is fetched from beside it with the
 * same options, and with the scene's query unless the scene gives it one of its own.
 *
 * @param url absolute address of the scene's own file.
 * @param optionsOf options for each part, by its path.
 */
export function openPartAt(url: string | URL, optionsOf: (path: string) => FetchSceneOptions): OpenPart {
  return (path, query) => fetchScene(partAddress(url, path, query), optionsOf(path));
}

/** Address of another file of the scene at an address. Every part of the path is encoded, so that it can be no address of another server. */
export function partAddress(url: string | URL, path: string, query = ''): URL {
  // Two slashes would begin the name of a server.
  const encoded = path
    .replace(/^\/+/, '/')
    .split('/')
    .map((part) => (part === '..' || part === '.' ? part : encodeURIComponent(part)));
  return partUrl(encoded.join('/') + query, url);
}
