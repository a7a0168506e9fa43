import {
  badStatus,
  chunksOf,
  fetchPatiently,
  forbidden,
  interrupted,
  label,
  SilenceError,
  unreachable,
} from '@gaussian-splat/core/fetch';
import { refuse } from './budget.js';
import { grouped, GrowingBytes } from './bytes.js';
import { lengthOf, tagOf } from './headers.js';
import type { FetchSceneOptions } from './fetch-scene.js';

/** Number of received bytes that are requested again and compared, because two files may have the same ETag. */
const OVERLAP = 1024;

/** Download of one file. It may take several connections, if some are interrupted. */
export class Download {
  readonly #address: URL;
  readonly #options: FetchSceneOptions;
  #response: Response | undefined;
  #body = new GrowingBytes(0);
  /** Byte offset in the file of the next chunk of the response. */
  #at = 0;
  #total: number | undefined;
  /** Validator of the file's version (ETag or Last-Modified); undefined if neither header is readable. */
  #tag: string | undefined;

  constructor(address: URL, options: FetchSceneOptions) {
    this.#address = address;
    this.#options = options;
  }

  /** Number of received bytes. */
  get length(): number {
    return this.#body.length;
  }

  /** The received bytes that are kept: all, unless `onArrival` has taken them. */
  get bytes(): Uint8Array {
    return this.#body.view();
  }

  /**
   * Requests the whole file.
   * @returns Undefined after success; the error if the server is temporarily unavailable (429, 503).
   * @throws GaussianSplatError `network/unreachable`, `network/status`, `out-of-memory/budget`
   */
  async start(): Promise<Error | undefined> {
    const response = await this.#request({});
    // A partial or empty response is not the file, although its status is not an error.
    if (response.status === 200 || response.status === 203) return void this.#begin(response);
    await discard(response);
    const error = badStatus(this.#address, response);
    if (response.status === 429 || response.status === 503) return error;
    throw error;
  }

  #begin(response: Response): void {
    this.#response = response;
    this.#at = 0;
    this.#total = lengthOf(response);
    this.#tag = tagOf(response);
    this.#requireRoom(this.#total ?? 0);
    this.#body = new GrowingBytes(this.#total ?? 65_536);
  }

  #requireRoom(bytes: number): void {
    const { maxBytes = Infinity } = this.#options;
    if (bytes <= maxBytes) return;
    void this.#response?.body?.cancel().catch(() => {});
    refuse(label(this.#address), `at most ${grouped(maxBytes)} bytes`, grouped(bytes));
  }

  /**
   * Requests the missing range if the file has a validator, otherwise the whole file. A server may respond with the whole
   * file in each case.
   * @returns Whether {@link read} can continue. False if there is no response or an unsuitable one; the next call then
   * requests the whole file if this one may have changed.
   */
  async resume(): Promise<boolean> {
    const from = Math.max(0, this.#body.length - OVERLAP);
    const [total, tag] = [this.#total, this.#tag];
    const isPart = from > 0 && total !== undefined && tag !== undefined;
    // A redirect may have led to another origin.
    const { origin } = new URL(this.#response?.url || this.#address);
    const isOwn = (globalThis.location?.origin ?? this.#address.origin) === origin;
    // `If-Range` causes a preflight request if it is sent cross-origin, and does not allow weak tags.
    const ifRange = isPart && isOwn && !tag.startsWith('W/') ? { 'If-Range': tag } : {};
    const headers = isPart ? { Range: `bytes=${from}-`, ...ifRange } : {};
    const response = await this.#request(headers).catch(() => undefined);
    this.#options.signal?.throwIfAborted();
    if (response?.status === 200) {
      this.#begin(response);
      return true;
    }
    if (response?.status === 206 && tagOf(response) === tag && this.#isRest(response, from)) {
      this.#response = response;
      this.#at = from;
      return true;
    }
    if (response === undefined) return false;
    await discard(response);
    if (response.status !== 429 && response.status < 500) this.#tag = undefined;
    return false;
  }

  /** Whether a partial response begins at the requested offset and ends at the end of the file. */
  #isRest(response: Response, from: number): boolean {
    const range = /^bytes (\d+)-(\d+)\/(\d+)$/.exec(response.headers.get('Content-Range') ?? '');
    if (range) return Number(range[1]) === from && Number(range[3]) === this.#total;
    // Cross-origin, scripts cannot read Content-Range, but Content-Length.
    return lengthOf(response) === (this.#total ?? 0) - from;
  }

  /**
   * Reads the response to its end, and calls `onProgress` and `onArrival` for each chunk.
   * @throws GaussianSplatError `network/interrupted` if the file is incomplete or has changed, `out-of-memory/budget`;
   * the reason of `signal`.
   */
  async read(): Promise<void> {
    const { signal, onProgress, onArrival } = this.#options;
    const body = this.#body;
    const broken = (cause: unknown): Error => interrupted(this.#address, cause, body.length, this.#total);
    const failed = (cause: unknown): unknown => (signal?.aborted ? signal.reason : broken(cause));
    for await (const value of this.#response ? chunksOf(this.#response, failed) : []) {
      const rest = this.#rest(value);
      if (rest === undefined) {
        // The file has changed. Without a validator, `resume` requests the whole file.
        this.#tag = undefined;
        throw broken(new Error('another file than before'));
      }
      if (rest.length === 0) continue;
      this.#requireRoom(body.length + rest.length);
      body.append(rest);
      // Cross-origin, scripts cannot read Content-Encoding. A body longer than declared shows that it is compressed.
      const total = this.#total !== undefined && body.length <= this.#total ? this.#total : undefined;
      onProgress?.(body.length, total);
      if (await onArrival?.(body.view(), total, body.first)) body.forget(OVERLAP);
    }
    // Some HTTP stacks end a broken connection without an error. Cross-origin, the length may be the compressed one.
    const isExact = this.#total !== undefined && this.#response?.type !== 'cors';
    if (isExact && body.length < this.#total!) throw broken(undefined);
  }

  /** Returns the new part of a chunk; undefined if the repeated part differs from the received bytes. */
  #rest(chunk: Uint8Array): Uint8Array | undefined {
    const from = this.#at - this.#body.first;
    const known = this.#body.view().subarray(from, from + chunk.length);
    this.#at += chunk.length;
    return known.every((byte, i) => byte === chunk[i]) ? chunk.subarray(known.length) : undefined;
  }

  async #request(headers: Record<string, string>): Promise<Response> {
    const { mode = 'cors', credentials = 'same-origin', signal } = this.#options;
    return fetchPatiently(this.#address, { mode, credentials, signal, headers }).catch(async (cause: unknown) => {
      signal?.throwIfAborted();
      if (cause instanceof SilenceError) throw unreachable(this.#address, cause);
      const isForbidden = mode === 'cors' && (await answersUnread(this.#address, signal));
      signal?.throwIfAborted();
      throw isForbidden ? forbidden(this.#address, cause) : unreachable(this.#address, cause);
    });
  }
}

/**
 * Whether a server of another origin responds to a request of mode `no-cors`. If it does, a failed request of mode `cors`
 * lacked CORS headers.
 */
async function answersUnread(address: URL, signal: AbortSignal | undefined): Promise<boolean> {
  const page = globalThis.location?.origin;
  if (page === undefined || page === address.origin || !address.protocol.startsWith('http')) return false;
  try {
    await discard(await fetchPatiently(address, { mode: 'no-cors', credentials: 'omit', method: 'HEAD', signal }));
    return true;
  } catch {
    return false;
  }
}

function discard({ body }: Response): Promise<void> {
  return body?.cancel().catch(() => {}) ?? Promise.resolve();
}
