import { GaussianSplatError } from '@gaussian-splat/core';
import { GrowingBytes, grouped, quote } from './bytes.js';

export interface FetchSceneOptions {
  /** `cors` (default) or `same-origin`; answers to `no-cors` requests cannot be read. */
  readonly mode?: 'cors' | 'same-origin';
  /** Which cookies are sent; default `same-origin`. */
  readonly credentials?: RequestCredentials;
  /** Aborts the download; the promise then rejects with the signal's reason. */
  readonly signal?: AbortSignal;
  /**
   * Called after every chunk with the bytes so far. The total is undefined where the server does not say it or says
   * the length of a compressed transfer, which is another number than that of the bytes that arrive.
   */
  readonly onProgress?: (loadedBytes: number, totalBytes: number | undefined) => void;
}

/** Largest Content-Length that is believed at once; longer files grow into place. */
const MAX_RESERVED_BYTES = 2 ** 28;

/**
 * Downloads a file with true progress.
 *
 * @param url absolute, or relative to the page or worker script (which in a worker made from a blob has no address:
 * resolve the URL before).
 * @throws GaussianSplatError `network/url`, `network/unreachable` (no server, offline, CORS, mixed content),
 * `network/status` or `network/interrupted`; the reason of `signal`, usually a DOMException named AbortError.
 */
export async function fetchScene(url: string | URL, options: FetchSceneOptions = {}): Promise<Uint8Array> {
  const { mode = 'cors', credentials = 'same-origin', signal, onProgress } = options;
  const address = parseUrl(url);
  const response = await fetch(address, { mode, credentials, signal }).catch((cause: unknown) => {
    signal?.throwIfAborted();
    throw unreachable(address, cause);
  });
  if (!response.ok) {
    await response.body?.cancel().catch(() => {});
    throw badStatus(address, response);
  }
  const total = lengthOf(response);
  const body = new GrowingBytes(Math.min(total ?? 65_536, MAX_RESERVED_BYTES));
  await readBody(response, body, total, address, options, onProgress);
  return body.view();
}

async function readBody(
  response: Response,
  body: GrowingBytes,
  total: number | undefined,
  address: URL,
  { signal }: FetchSceneOptions,
  onProgress: FetchSceneOptions['onProgress'],
): Promise<void> {
  const reader = response.body?.getReader();
  for (;;) {
    const chunk = await reader?.read().catch((cause: unknown) => {
      signal?.throwIfAborted();
      throw interrupted(address, body.length, total, cause);
    });
    if (!chunk || chunk.done) break;
    body.append(chunk.value);
    // Across origins a Content-Encoding is hidden from scripts; a body longer than announced gives it away.
    const isWithin = total !== undefined && body.length <= total;
    onProgress?.(body.length, isWithin ? total : undefined);
  }
  // Some HTTP stacks end a broken connection without an error. Across origins the length may be that of an encoding.
  const isExact = total !== undefined && response.type !== 'cors';
  if (isExact && body.length < total) throw interrupted(address, body.length, total, undefined);
}

/** Length of the body in bytes if the headers tell it. */
function lengthOf({ headers }: Response): number | undefined {
  const encoding = headers.get('Content-Encoding');
  const length = headers.get('Content-Length');
  const isPlain = encoding === null || /^\s*(identity)?\s*$/i.test(encoding);
  return isPlain && length !== null && /^\d+$/.test(length) ? Number(length) : undefined;
}

function parseUrl(url: string | URL): URL {
  const base = globalThis.location?.href;
  const refuse = (shown: string, found: string, cause?: unknown): never => {
    throw new GaussianSplatError('network/url', {
      where: `address ${quote(shown, 200)}`,
      expected: base ? `an absolute URL or one relative to ${base.slice(0, 200)}` : 'an absolute URL',
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

function unreachable(address: URL, cause: unknown): GaussianSplatError {
  return new GaussianSplatError('network/unreachable', {
    where: label(address),
    expected: 'an answer from the server',
    found: `none that may be read (${(cause as Error)?.message ?? 'unknown cause'})`,
    remedy:
      'check the address and the connection; if the scene is on another server, that server must send ' +
      '"Access-Control-Allow-Origin", and a page on https cannot load from http',
    cause,
  });
}

const REMEDIES: ReadonlyMap<number, string> = new Map([
  [401, 'log in, or set crossorigin="use-credentials" if the server needs cookies'],
  [403, 'give the file public read access, or set crossorigin="use-credentials" if the server needs cookies'],
  [404, 'check the path and the spelling, capital letters included'],
  [410, 'use another address; the file was removed'],
  [429, 'try again later; the server limits the number of requests'],
]);

function badStatus(address: URL, { status, statusText }: Response): GaussianSplatError {
  const remedy =
    status >= 500 ? 'try again later or look into the log of the server' : 'check the address of the scene';
  return new GaussianSplatError('network/status', {
    where: label(address),
    expected: 'HTTP status 200',
    found: `HTTP status ${status}${statusText ? ` (${statusText})` : ''}`,
    remedy: REMEDIES.get(status) ?? remedy,
  });
}

function interrupted(address: URL, loaded: number, total: number | undefined, cause: unknown): GaussianSplatError {
  return new GaussianSplatError('network/interrupted', {
    where: `${label(address)}, byte ${grouped(loaded)}`,
    expected: total === undefined ? 'the rest of the file' : `${grouped(total)} bytes`,
    found: `the end of the connection after ${grouped(loaded)} bytes`,
    remedy: 'load the scene again; the connection broke off',
    cause,
  });
}

/** The address for messages, short where it carries its data along. */
function label({ href }: URL): string {
  return href.length > 200 ? `${href.slice(0, 200)}...` : href;
}
