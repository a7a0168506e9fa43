/** Addresses of files, and errors of failed downloads. */
import { GaussianSplatError } from './errors.js';
import { grouped } from './grouped.js';

/**
 * Returns an address as an absolute URL. Relative ones refer to the page or the script of the worker.
 * @throws GaussianSplatError `network/url`, also for an address with a user name or a password.
 */
export function parseUrl(url: string | URL): URL {
  const base = globalThis.location?.href;
  const refuse = (shown: string, found: string, cause?: unknown): never => {
    throw new GaussianSplatError('network/url', {
      where: `address ${JSON.stringify(clipped(shown))}`,
      // In a worker the base is the worker's script, which is meaningless to the user.
      expected: base ? 'an absolute URL or a relative one' : 'an absolute URL',
      found,
      remedy: 'correct the address',
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

export function unreachable(address: URL | string, cause: unknown): GaussianSplatError {
  return new GaussianSplatError('network/unreachable', {
    where: label(address),
    expected: 'a response from the server',
    found: `no readable response (${(cause as Error)?.message ?? 'unknown cause'})`,
    remedy:
      'check the address and the connection; if the file is on another server, that server must send ' +
      '"Access-Control-Allow-Origin", and a page on https cannot load from http',
    cause,
  });
}

/** @param address Address on a server that answers requests, but forbids pages of other origins to read the answers. */
export function forbidden(address: URL, cause: unknown): GaussianSplatError {
  return new GaussianSplatError('network/unreachable', {
    where: label(address),
    expected: `permission for pages of ${globalThis.location.origin} to read the response (CORS)`,
    found: 'a response without it',
    remedy: `have that server send "Access-Control-Allow-Origin: ${globalThis.location.origin}" (or "*"), or serve the file from the page's own`,
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

export function badStatus(address: URL | string, { status, statusText }: Response): GaussianSplatError {
  return new GaussianSplatError('network/status', {
    where: label(address),
    expected: 'HTTP status 200',
    found: `HTTP status ${status}${statusText ? ` (${statusText})` : ''}`,
    remedy:
      REMEDIES.get(status) ??
      (status >= 500 ? 'try again later or check the log of the server' : 'check the address of the file'),
  });
}

/** @param loaded Number of received bytes, if known. @param total Number of expected bytes, if known. */
export function interrupted(
  address: URL | string,
  cause: unknown,
  loaded?: number,
  total?: number,
): GaussianSplatError {
  const after = loaded === undefined ? undefined : grouped(loaded);
  return new GaussianSplatError('network/interrupted', {
    where: after === undefined ? label(address) : `${label(address)}, byte ${after}`,
    expected: total === undefined ? 'the rest of the file' : `${grouped(total)} bytes`,
    found: `the end of the connection ${after === undefined ? `(${(cause as Error)?.message ?? 'unknown cause'})` : `after ${after} bytes`}`,
    remedy: 'load it again; the connection broke off',
    cause,
  });
}

/** @param before Validator of the version that was requested first. @param now Validator of the current version. */
export function changed(address: URL, before: string, now: string): GaussianSplatError {
  return new GaussianSplatError('network/changed', {
    where: label(address),
    expected: `the version of the file that began to load (${before.slice(0, 80)})`,
    found: `another version (${now.slice(0, 80)})`,
    remedy: 'load it again; the file has been replaced on its server',
  });
}

/** Returns an address for error messages; data URLs may have millions of characters. */
export const label = (address: URL | string): string => clipped(String(address));

const clipped = (text: string): string => (text.length > 200 ? `${text.slice(0, 200)}...` : text);
