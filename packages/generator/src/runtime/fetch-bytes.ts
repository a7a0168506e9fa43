import { GaussianSplatError } from '@gaussian-splat/core';

/** How files are fetched. */
export interface FetchOptions {
  /** Which cookies are sent; default `same-origin`. */
  readonly credentials?: RequestCredentials;
  readonly signal?: AbortSignal;
  /** Bytes so far, and the number of all of them where the server tells. */
  readonly onProgress?: (loaded: number, total: number | undefined) => void;
}

/**
 * A whole file; undefined where the server says that there is none and `mayBeMissing` allows it.
 * @throws GaussianSplatError `network/unreachable`, `network/status`, `network/interrupted`; the reason of the signal.
 */
export async function fetchBytes(
  url: string,
  options: FetchOptions & { readonly mayBeMissing: true },
): Promise<Uint8Array<ArrayBuffer> | undefined>;
export async function fetchBytes(url: string, options?: FetchOptions): Promise<Uint8Array<ArrayBuffer>>;
export async function fetchBytes(
  url: string,
  options: FetchOptions & { readonly mayBeMissing?: boolean } = {},
): Promise<Uint8Array<ArrayBuffer> | undefined> {
  const { credentials = 'same-origin', signal, mayBeMissing } = options;
  const response = await fetch(url, { credentials, signal }).catch((cause: unknown) => {
    signal?.throwIfAborted();
    throw unreachable(url, cause);
  });
  if (!response.ok) {
    await response.body?.cancel().catch(() => undefined);
    if (mayBeMissing) return undefined;
    throw badStatus(url, response.status);
  }
  try {
    return await readBody(response, options);
  } catch (cause) {
    signal?.throwIfAborted();
    throw interrupted(url, cause);
  }
}

async function readBody(response: Response, { onProgress }: FetchOptions): Promise<Uint8Array<ArrayBuffer>> {
  if (onProgress === undefined || response.body === null) return new Uint8Array(await response.arrayBuffer());
  const length = Number(response.headers.get('Content-Length')) || undefined;
  const total = response.headers.get('Content-Encoding') ? undefined : length;
  const pieces: Uint8Array[] = [];
  let loaded = 0;
  const reader = response.body.getReader();
  for (let step = await reader.read(); !step.done; step = await reader.read()) {
    pieces.push(step.value);
    loaded += step.value.length;
    onProgress(loaded, total);
  }
  const bytes = new Uint8Array(loaded);
  let at = 0;
  for (const piece of pieces) {
    bytes.set(piece, at);
    at += piece.length;
  }
  return bytes;
}

const shorten = (url: string): string => url.slice(0, 200);

const unreachable = (url: string, cause: unknown): GaussianSplatError =>
  new GaussianSplatError('network/unreachable', {
    where: shorten(url),
    expected: 'an answer from the server',
    found: `none that may be read (${(cause as Error)?.message ?? 'unknown cause'})`,
    remedy: 'check the address and the connection; a server of another origin must send "Access-Control-Allow-Origin"',
    cause,
  });

const badStatus = (url: string, status: number): GaussianSplatError =>
  new GaussianSplatError('network/status', {
    where: shorten(url),
    expected: 'HTTP status 200',
    found: `HTTP status ${status}`,
    remedy: status === 404 ? 'check the path and the spelling, capital letters included' : 'check the address',
  });

const interrupted = (url: string, cause: unknown): GaussianSplatError =>
  new GaussianSplatError('network/interrupted', {
    where: shorten(url),
    expected: 'the rest of the file',
    found: `the end of the connection (${(cause as Error)?.message ?? 'unknown cause'})`,
    remedy: 'load it again; the connection broke off',
    cause,
  });
