import { badStatus, bytesOf, chunksOf, fetchPatiently, interrupted, unreachable } from '@gaussian-splat/core/fetch';

/** Called with the received and the total bytes. The total is undefined while unknown. */
export type ProgressListener = (loaded: number, total: number | undefined) => void;

/** Options of downloads. */
export interface FetchOptions {
  /** Policy for cookies. Default: `same-origin`. */
  readonly credentials?: RequestCredentials;
  readonly signal?: AbortSignal;
  /** Called with the received bytes, and the total if the server declares it or `expected` is set. */
  readonly onProgress?: ProgressListener;
  /** Expected length of the file in bytes. Servers that compress a file do not declare its length. */
  readonly expected?: number;
  /** Maximum length of a file that is fetched without `onProgress`. A longer one has a RangeError as its cause. */
  readonly maxBytes?: number;
}

/** Number of retries while the server is temporarily unavailable (429, 503), as for scenes. */
const RETRIES = 3;
/** Milliseconds before the first retry; each further delay is twice as long. */
const RETRY_DELAY_MS = 250;

/**
 * Fetches a whole file. A server that is temporarily unavailable is asked again. Returns undefined if `mayBeMissing` is
 * true and the server refuses the request by a status below 500; one that fails may have the file.
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
  const { signal, mayBeMissing } = options;
  const response = await request(url, options);
  if (!response.ok) {
    await response.body?.cancel().catch(() => undefined);
    if (mayBeMissing && response.status < 500 && !isBusy(response)) return undefined;
    throw badStatus(url, response);
  }
  try {
    return await readBody(response, options);
  } catch (cause) {
    signal?.throwIfAborted();
    throw interrupted(url, cause);
  }
}

const isBusy = ({ status }: Response): boolean => status === 429 || status === 503;

async function request(url: string, { credentials = 'same-origin', signal }: FetchOptions): Promise<Response> {
  for (let tries = 0; ; tries++) {
    const response = await fetchPatiently(url, { credentials, signal }).catch((cause: unknown) => {
      signal?.throwIfAborted();
      throw unreachable(url, cause);
    });
    if (tries >= RETRIES || !isBusy(response)) return response;
    await response.body?.cancel().catch(() => undefined);
    await new Promise((resolve) => setTimeout(resolve, RETRY_DELAY_MS * 2 ** tries));
    signal?.throwIfAborted();
  }
}

/** Bytes of the initial allocation for a file of unknown length. */
const FIRST_BYTES = 65_536;
/** A declared length above the maximum is allocated only after some bytes have arrived, because a server may lie. */
const MAX_AT_ONCE = 2 ** 28;
const CAUTIOUS_BYTES = 2 ** 26;

async function readBody(
  response: Response,
  { onProgress, expected, maxBytes }: FetchOptions,
): Promise<Uint8Array<ArrayBuffer>> {
  if (onProgress === undefined) return bytesOf(response, undefined, maxBytes);
  const length = Number(response.headers.get('Content-Length')) || undefined;
  const total = (response.headers.get('Content-Encoding') ? undefined : length) ?? expected;
  let bytes = new Uint8Array(total !== undefined && total > MAX_AT_ONCE ? CAUTIOUS_BYTES : (total ?? FIRST_BYTES));
  let loaded = 0;
  for await (const chunk of chunksOf(response)) {
    const end = loaded + chunk.length;
    if (end > bytes.length)
      bytes = grown(bytes, Math.max(end, total !== undefined && end <= total ? total : 2 * bytes.length));
    bytes.set(chunk, loaded);
    loaded = end;
    // If the file is longer than declared, the total grows with the received bytes.
    onProgress(loaded, total && Math.max(loaded, total));
  }
  return loaded === bytes.length ? bytes : bytes.slice(0, loaded);
}

function grown(bytes: Uint8Array, length: number): Uint8Array<ArrayBuffer> {
  const larger = new Uint8Array(length);
  larger.set(bytes);
  return larger;
}

/**
 * Returns listeners for several downloads that report the sum to one listener. The total is undefined until the total
 * of each download is known.
 */
export function sumProgress(count: number, onProgress: ProgressListener): readonly ProgressListener[] {
  const downloads: { loaded: number; total: number | undefined }[] = Array.from({ length: count }, () => ({
    loaded: 0,
    total: undefined,
  }));
  return downloads.map((download) => (loaded, total) => {
    Object.assign(download, { loaded, total });
    const sum = downloads.reduce<number | undefined>((sum, { total }) => addUnlessUnknown(sum, total), 0);
    onProgress(
      downloads.reduce((sum, { loaded }) => sum + loaded, 0),
      sum,
    );
  });
}

const addUnlessUnknown = (a: number | undefined, b: number | undefined): number | undefined =>
  a === undefined || b === undefined ? undefined : a + b;
