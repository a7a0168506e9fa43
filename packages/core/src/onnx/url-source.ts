import { GaussianSplatError } from '../errors.js';
import { badStatus, interrupted, label, parseUrl, unreachable } from '../network-errors.js';
import { bytesOf, fetchPatiently, SilenceError } from '../patient-fetch.js';
import { type ByteSource } from './byte-source.js';

export interface UrlSourceOptions {
  /** Mode of requests, as in `RequestInit`. Default: `cors`. */
  readonly mode?: 'cors' | 'same-origin';
  /** Credentials mode of requests, as in `RequestInit`. Default: `same-origin`. */
  readonly credentials?: 'omit' | 'same-origin' | 'include';
  /** Aborts every request; reads then reject with the signal's reason. */
  readonly signal?: AbortSignal;
  /** Bytes of one Range request. Default: 65,536. */
  readonly chunk?: number;
  /**
   * Maximum number of requests. A read after that fetches the whole file, because many small requests take longer than
   * one large request. Default: 32.
   */
  readonly maxRequests?: number;
  /** Maximum bytes of a response. A longer one is `out-of-memory/budget`. Default: no limit. */
  readonly maxBytes?: number | undefined;
}

/** A file on a server, which is read by HTTP Range if possible. */
export interface UrlSource extends ByteSource {
  /** Number of requests that have been sent. */
  readonly requests: number;
  /** Total bytes of the bodies that have been received. */
  readonly bytesReceived: number;
  /** Bytes of the whole file if it has been fetched as a whole; otherwise undefined. */
  readonly whole: Uint8Array | undefined;
}

const DEFAULT_CHUNK = 65_536;
const DEFAULT_MAX_REQUESTS = 32;
/** Status codes of servers that reject the Range header rather than the file. */
const RANGE_REFUSALS = [400, 405, 412, 416, 501];

/**
 * Opens a file on a server for reading by HTTP Range; if the server or the browser rejects Range, the whole file is
 * fetched. A server that does not respond for 30 s is abandoned; a connection with less than 1 KiB in 30 s counts as
 * broken.
 *
 * @param url Address of the file, absolute or relative to the page.
 * @throws GaussianSplatError `network/url`, `network/unreachable`, `network/status`, `network/interrupted` or
 * `out-of-memory/budget`; the reason of the signal.
 */
export async function openUrl(url: string | URL, options: UrlSourceOptions = {}): Promise<UrlSource> {
  const file = new RemoteFile(parseUrl(url), options);
  await file.open();
  return file;
}

class RemoteFile implements UrlSource {
  readonly #address: URL;
  readonly #options: UrlSourceOptions;
  readonly #maxRequests: number;
  readonly name: string;
  readonly chunk: number;
  requests = 0;
  bytesReceived = 0;
  size = 0;
  whole: Uint8Array | undefined;
  /** The first {@link chunk} bytes, which opening the file has fetched. */
  #head: Uint8Array | undefined;

  constructor(address: URL, options: UrlSourceOptions) {
    this.#address = address;
    this.#options = options;
    this.#maxRequests = options.maxRequests ?? DEFAULT_MAX_REQUESTS;
    this.name = label(address);
    this.chunk = options.chunk ?? DEFAULT_CHUNK;
  }

  async open(): Promise<void> {
    const response = await this.#requestRange(0, this.chunk);
    const size = response && (sizeFromContentRange(response) ?? (await this.#sizeByHead()));
    if (response === undefined || size === undefined) return this.#fetchWhole();
    const head = await this.#body(response);
    if (head.length !== Math.min(size, this.chunk)) return this.#fetchWhole();
    this.size = size;
    this.#head = head;
  }

  async read(offset: number, length: number): Promise<Uint8Array> {
    const end = Math.min(offset + length, this.size);
    if (offset >= end) return new Uint8Array(0);
    if (this.whole === undefined && this.#head && end <= this.#head.length) return this.#head.subarray(offset, end);
    if (this.whole === undefined) {
      const piece = await this.#fetchPiece(offset, end);
      if (piece) return piece;
      await this.#fetchWhole();
    }
    return this.whole!.subarray(offset, end);
  }

  /** Fetches the bytes from `offset` to `end`. Returns undefined if the whole file must be fetched instead. */
  async #fetchPiece(offset: number, end: number): Promise<Uint8Array | undefined> {
    if (this.requests >= this.#maxRequests) return undefined;
    const response = await this.#requestRange(offset, end);
    if (response === undefined) return undefined;
    const total = sizeFromContentRange(response);
    const piece = await this.#body(response);
    // Another length means that the file was replaced meanwhile, or that a proxy responds with other content.
    return piece.length === end - offset && (total ?? this.size) === this.size ? piece : undefined;
  }

  /**
   * Returns the response to a Range request; undefined if the server rejects Range, or responds with the whole file,
   * which is then kept.
   */
  async #requestRange(offset: number, end: number): Promise<Response | undefined> {
    let response: Response;
    try {
      response = await this.#request({ headers: { Range: `bytes=${offset}-${end - 1}` } });
    } catch (error) {
      this.#options.signal?.throwIfAborted();
      // If Range is not safelisted, the browser sends a preflight request, which many servers reject.
      const isSilent = error instanceof GaussianSplatError && error.cause instanceof SilenceError;
      if (error instanceof GaussianSplatError && error.code === 'network/unreachable' && !isSilent) return undefined;
      throw error;
    }
    if (response.status === 206 && isPlain(response)) return response;
    if (response.status === 200) {
      this.#keepWhole(await this.#body(response));
      return undefined;
    }
    await response.body?.cancel().catch(() => {});
    if (response.status === 206 || RANGE_REFUSALS.includes(response.status)) return undefined;
    throw badStatus(this.name, response);
  }

  /**
   * Requests the size of the file by HEAD; undefined if the response does not contain it. Across origins, Content-Range is
   * often hidden from scripts, but Content-Length is not.
   */
  async #sizeByHead(): Promise<number | undefined> {
    const response = await this.#request({ method: 'HEAD' });
    const length = response.headers.get('Content-Length');
    return response.ok && isPlain(response) && /^\d+$/.test(length ?? '') ? Number(length) : undefined;
  }

  async #fetchWhole(): Promise<void> {
    if (this.whole !== undefined) return;
    const response = await this.#request({});
    if (!response.ok) {
      await response.body?.cancel().catch(() => {});
      throw badStatus(this.name, response);
    }
    this.#keepWhole(await this.#body(response));
  }

  #keepWhole(bytes: Uint8Array): void {
    this.whole = bytes;
    this.size = bytes.length;
    this.#head = undefined;
  }

  async #request(init: RequestInit): Promise<Response> {
    const { mode = 'cors', credentials = 'same-origin', signal } = this.#options;
    this.requests++;
    return fetchPatiently(this.#address, { ...init, mode, credentials, signal }).catch((cause: unknown) => {
      signal?.throwIfAborted();
      throw unreachable(this.name, cause);
    });
  }

  async #body(response: Response): Promise<Uint8Array> {
    const { signal, maxBytes } = this.#options;
    const failed = (cause: unknown): unknown => (signal?.aborted ? signal.reason : interrupted(this.name, cause));
    const bytes = await bytesOf(response, failed, maxBytes).catch((cause: unknown) => {
      if (!(cause instanceof RangeError)) throw cause;
      throw new GaussianSplatError('out-of-memory/budget', {
        where: this.name,
        expected: `at most ${String(maxBytes)} bytes`,
        found: 'more',
        remedy: 'use a smaller model, or raise the limit',
        cause,
      });
    });
    this.bytesReceived += bytes.length;
    return bytes;
  }
}

function sizeFromContentRange(response: Response): number | undefined {
  const match = /^bytes \d+-\d+\/(\d+)$/.exec(response.headers.get('Content-Range') ?? '');
  return match ? Number(match[1]) : undefined;
}

/** Whether a response has no content encoding: lengths and ranges of an encoded response differ from the file's. */
function isPlain(response: Response): boolean {
  return /^\s*(identity)?\s*$/i.test(response.headers.get('Content-Encoding') ?? '');
}
