import { chunksOf, fetchPatiently, SilenceError } from '@gaussian-splat/core/fetch';
import { refuse } from './budget.js';
import { grouped, GrowingBytes } from './bytes.js';
import { badStatus, forbidden, interrupted, label, unreachable } from './network-errors.js';
import type { FetchSceneOptions } from './fetch-scene.js';

/** Bytes before the break that are asked for again, and compared: a tag may be the same, and the file another. */
const OVERLAP = 1024;

/** One file on its way, over one connection after another. */
export class Download {
  readonly #address: URL;
  readonly #options: FetchSceneOptions;
  #response: Response | undefined;
  #body = new GrowingBytes(0);
  /** Byte of the file that the response begins with. */
  #at = 0;
  #total: number | undefined;
  /** What tells one state of the file from another; undefined where the server or CORS keeps it hidden. */
  #tag: string | undefined;

  constructor(address: URL, options: FetchSceneOptions) {
    this.#address = address;
    this.#options = options;
  }

  /** All bytes so far. */
  get bytes(): Uint8Array {
    return this.#body.view();
  }

  /** Asks for the whole file. @returns the error of a server that has no time now. */
  async start(): Promise<Error | undefined> {
    const response = await this.#request({});
    // A partial answer or an empty one is no file, although its status is no error.
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
   * Asks for what is missing where it can be told whether that belongs to what has come, or for all of it; of a server that sends the whole file again, that is taken.
   * @returns false if nobody answers, the server has no time now, or the file is another: then all of it is to be asked for again
   */
  async resume(): Promise<boolean> {
    const from = Math.max(0, this.#body.length - OVERLAP);
    const [total, tag] = [this.#total, this.#tag];
    const isPart = from > 0 && total !== undefined && tag !== undefined;
    const isOwn = (globalThis.location?.origin ?? this.#address.origin) === this.#address.origin;
    // Servers of other origins would be asked first whether they allow that header, and weak tags are not for it.
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

  /** True if a partial answer begins where it ought to and ends where the file ends. */
  #isRest(response: Response, from: number): boolean {
    const range = /^bytes (\d+)-(\d+)\/(\d+)$/.exec(response.headers.get('Content-Range') ?? '');
    if (range) return Number(range[1]) === from && Number(range[3]) === this.#total;
    // Across origins that header is hidden from scripts, but the length is not.
    return lengthOf(response) === (this.#total ?? 0) - from;
  }

  /** Reads to the end of the connection. Throws `network/interrupted` if that is not the end of the file. */
  async read(): Promise<void> {
    const { signal, onProgress, onArrival } = this.#options;
    const body = this.#body;
    const broken = (cause: unknown): Error => interrupted(this.#address, body.length, this.#total, cause);
    const failed = (cause: unknown): unknown => (signal?.aborted ? signal.reason : broken(cause));
    for await (const value of this.#response ? chunksOf(this.#response, failed) : []) {
      const rest = this.#rest(value);
      if (rest === undefined) {
        // Nothing of it is right: all is asked for again.
        this.#tag = undefined;
        throw broken(new Error('another file than before'));
      }
      if (rest.length === 0) continue;
      this.#requireRoom(body.length + rest.length);
      body.append(rest);
      // Across origins a Content-Encoding is hidden from scripts; a body longer than announced gives it away.
      const total = this.#total !== undefined && body.length <= this.#total ? this.#total : undefined;
      onProgress?.(body.length, total);
      await onArrival?.(body.view(), total);
    }
    // Some HTTP stacks end a broken connection without an error. Across origins the length may be that of an encoding.
    const isExact = this.#total !== undefined && this.#response?.type !== 'cors';
    if (isExact && body.length < this.#total!) throw broken(undefined);
  }

  /** What of a chunk has not come before; undefined if what has come before was other bytes. */
  #rest(chunk: Uint8Array): Uint8Array | undefined {
    const known = this.#body.view().subarray(this.#at, this.#at + chunk.length);
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

/** True if a server of another origin answers requests whose answer nobody may read: then it is CORS that is missing. */
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

/** Length of the body in bytes if the headers tell it. */
function lengthOf({ headers }: Response): number | undefined {
  const encoding = headers.get('Content-Encoding');
  const length = headers.get('Content-Length');
  const isPlain = encoding === null || /^\s*(identity)?\s*$/i.test(encoding);
  return isPlain && length !== null && /^\d+$/.test(length) ? Number(length) : undefined;
}

function tagOf({ headers }: Response): string | undefined {
  return headers.get('ETag') ?? headers.get('Last-Modified') ?? undefined;
}
