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
  /** Bytes that were there when the connection before this one broke. */
  #resumedAt = -1;

  constructor(address: URL, options: FetchSceneOptions) {
    this.#address = address;
    this.#options = options;
  }

  /** All bytes so far. */
  get bytes(): Uint8Array {
    return this.#body.view();
  }

  /** True if the rest can be asked for: some of the file is there, its length is known, and the last try was not in vain. */
  get canResume(): boolean {
    const { length } = this.#body;
    const isWithin = this.#total !== undefined && length > 0 && length < this.#total;
    return isWithin && length > this.#resumedAt && this.#options.signal?.aborted !== true;
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

  /** Asks for what is missing; of a server that sends the whole file again, that is taken. False if the server sends something else, or the file has changed. */
  async resume(): Promise<boolean> {
    const from = this.#body.length;
    this.#resumedAt = from;
    const response = await this.#request({ Range: `bytes=${from}-` }).catch(() => undefined);
    this.#options.signal?.throwIfAborted();
    if (response === undefined) return false;
    if (response.status === 200) {
      this.#begin(response);
      return true;
    }
    const tag = tagOf(response);
    const isSame = this.#tag === undefined || tag === undefined || tag === this.#tag;
    if (response.status === 206 && isSame && this.#isRest(response, from)) {
      this.#response = response;
      return true;
    }
    await discard(response);
    return false;
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
      const chunk = await reader?.read().catch((cause: unknown) => {
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
