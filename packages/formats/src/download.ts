import { GrowingBytes } from './bytes.js';
import { badStatus, forbidden, interrupted, unreachable } from './network-errors.js';
import type { FetchSceneOptions } from './fetch-scene.js';

/** One file on its way, over one connection after another. */
export class Download {
  readonly #address: URL;
  readonly #options: FetchSceneOptions;
  #response: Response | undefined;
  #body = new GrowingBytes(0);
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

  /** Asks for the whole file. */
  async start(): Promise<void> {
    const response = await this.#request({});
    if (!response.ok) {
      await discard(response);
      throw badStatus(this.#address, response);
    }
    this.#begin(response);
  }

  #begin(response: Response): void {
    this.#response = response;
    this.#total = lengthOf(response);
    this.#tag = tagOf(response);
    this.#body = new GrowingBytes(this.#total ?? 65_536);
  }

  /**
   * Asks for what is missing, or for all of it where nothing has come or the length is not known; of a server that sends the whole file again, that is taken. `later`: nobody
   * answers, or the server has no time now. `changed`: it sends something else, or the file has changed.
   */
  async resume(): Promise<'begun' | 'later' | 'changed'> {
    const from = this.#body.length;
    const isPart = from > 0 && this.#total !== undefined;
    const response = await this.#request(isPart ? { Range: `bytes=${from}-` } : {}).catch(() => undefined);
    this.#options.signal?.throwIfAborted();
    if (response === undefined) return 'later';
    if (response.status === 200) {
      this.#begin(response);
      return 'begun';
    }
    const tag = tagOf(response);
    const isSame = this.#tag === undefined || tag === undefined || tag === this.#tag;
    if (response.status === 206 && isSame && this.#isRest(response, from)) {
      this.#response = response;
      return 'begun';
    }
    await discard(response);
    return response.status === 429 || response.status >= 500 ? 'later' : 'changed';
  }

  /** True if a partial answer begins where we stopped and ends where the file ends. */
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
    const reader = this.#response?.body?.getReader();
    const broken = (cause: unknown): Error => interrupted(this.#address, body.length, this.#total, cause);
    for (;;) {
      const chunk = await (reader ? withinPatience(reader) : undefined)?.catch((cause: unknown) => {
        signal?.throwIfAborted();
        throw broken(cause);
      });
      if (!chunk || chunk.done) break;
      body.append(chunk.value);
      // Across origins a Content-Encoding is hidden from scripts; a body longer than announced gives it away.
      const total = this.#total !== undefined && body.length <= this.#total ? this.#total : undefined;
      onProgress?.(body.length, total);
      await onArrival?.(body.view(), total);
    }
    // Some HTTP stacks end a broken connection without an error. Across origins the length may be that of an encoding.
    const isExact = this.#total !== undefined && this.#response?.type !== 'cors';
    if (isExact && body.length < this.#total!) throw broken(undefined);
  }

  async #request(headers: Record<string, string>): Promise<Response> {
    const { mode = 'cors', credentials = 'same-origin', signal } = this.#options;
    return fetch(this.#address, { mode, credentials, signal, headers }).catch(async (cause: unknown) => {
      signal?.throwIfAborted();
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
    await discard(await fetch(address, { mode: 'no-cors', credentials: 'omit', method: 'HEAD', signal }));
    return true;
  } catch {
    return false;
  }
}

/** A connection on which nothing comes for so long has broken without a word, ms. */
const PATIENCE_MS = 30_000;

/** The next piece of a body, or a rejection where none comes. */
async function withinPatience<T>(reader: ReadableStreamDefaultReader<T>): Promise<ReadableStreamReadResult<T>> {
  let timer: ReturnType<typeof setTimeout> | undefined;
  const stalled = new Promise<never>((_, reject) => {
    timer = setTimeout(() => {
      reject(new Error(`nothing came for ${PATIENCE_MS / 1000} s`));
      void reader.cancel().catch(() => {});
    }, PATIENCE_MS);
  });
  return Promise.race([reader.read(), stalled]).finally(() => clearTimeout(timer));
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
