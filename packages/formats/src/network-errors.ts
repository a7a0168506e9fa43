import { GaussianSplatError } from '@gaussian-splat/core';
import { grouped } from './bytes.js';

/** Errors of failed downloads. */

export function unreachable(address: URL, cause: unknown): GaussianSplatError {
  return new GaussianSplatError('network/unreachable', {
    where: label(address),
    expected: 'a response from the server',
    found: `no readable response (${(cause as Error)?.message ?? 'unknown cause'})`,
    remedy:
      'check the address and the connection; if the scene is on another server, that server must send ' +
      '"Access-Control-Allow-Origin", and a page on https cannot load from http',
    cause,
  });
}

export function forbidden(address: URL, cause: unknown): GaussianSplatError {
  return new GaussianSplatError('network/unreachable', {
    where: label(address),
    expected: `permission for pages of ${globalThis.location.origin} to read the response (CORS)`,
    found: 'a response without it',
    remedy: `have that server send "Access-Control-Allow-Origin: ${globalThis.location.origin}" (or "*"), or serve the scene from the page's own`,
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

export function badStatus(address: URL, { status, statusText }: Response): GaussianSplatError {
  const remedy = status >= 500 ? 'try again later or check the log of the server' : 'check the address of the scene';
  return new GaussianSplatError('network/status', {
    where: label(address),
    expected: 'HTTP status 200',
    found: `HTTP status ${status}${statusText ? ` (${statusText})` : ''}`,
    remedy: REMEDIES.get(status) ?? remedy,
  });
}

export function interrupted(
  address: URL,
  loaded: number,
  total: number | undefined,
  cause: unknown,
): GaussianSplatError {
  return new GaussianSplatError('network/interrupted', {
    where: `${label(address)}, byte ${grouped(loaded)}`,
    expected: total === undefined ? 'the rest of the file' : `${grouped(total)} bytes`,
    found: `the end of the connection after ${grouped(loaded)} bytes`,
    remedy: 'load the scene again; the connection broke off',
    cause,
  });
}

/** @param before Validator of the version that was requested first. @param now Validator of the current version. */
export function changed(address: URL, before: string, now: string): GaussianSplatError {
  return new GaussianSplatError('network/changed', {
    where: label(address),
    expected: `the version of the file that began to load (${before.slice(0, 80)})`,
    found: `another version (${now.slice(0, 80)})`,
    remedy: 'load the scene again; the file has been replaced on its server',
  });
}

/** Returns the first 200 characters of a URL for error messages; data URLs may have millions. */
export function label({ href }: URL): string {
  return href.length > 200 ? `${href.slice(0, 200)}...` : href;
}
