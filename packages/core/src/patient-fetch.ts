/**
 * Milliseconds after which a server without a response is abandoned. A connection that delivers less than {@link
 * SILENCE_BYTES} in this time counts as broken.
 */
export const SILENCE_MS = 30_000;
const SILENCE_BYTES = 1024;
/**
 * Codes of Node for a kept connection that the server closed meanwhile. Browsers send such a request again by
 * themselves (RFC 9112, 9.3.1), Node does not.
 */
const CLOSED = /^(ECONNRESET|EPIPE|UND_ERR_SOCKET)$/;
const MAX_REPEATS = 2;

/** A server or connection that sent too little data within {@link SILENCE_MS}. */
export class SilenceError extends Error {
  constructor() {
    super(`nothing came for ${SILENCE_MS / 1000} s`);
  }
}

/**
 * Fetches as `fetch` does, but also rejects with a {@link SilenceError} if no headers arrive within {@link SILENCE_MS}.
 */
export async function fetchPatiently(url: string | URL, { signal, ...init }: RequestInit = {}): Promise<Response> {
  const silence = new AbortController();
  const timer = setTimeout(() => silence.abort(new SilenceError()), SILENCE_MS);
  const either = signal ? AbortSignal.any([signal, silence.signal]) : silence.signal;
  try {
    return await send(url, { ...init, signal: either });
  } catch (error) {
    signal?.throwIfAborted();
    throw silence.signal.aborted ? silence.signal.reason : error;
  } finally {
    clearTimeout(timer);
  }
}

async function send(url: string | URL, init: RequestInit, repeats = 0): Promise<Response> {
  try {
    return await fetch(url, init);
  } catch (error) {
    const { code = '' } = ((error as Error | undefined)?.cause as { code?: string } | undefined) ?? {};
    if (repeats === MAX_REPEATS || !CLOSED.test(code)) throw error;
    return send(url, init, repeats + 1);
  }
}

/**
 * Iterates over the chunks of a response's body. Leaving the loop early closes the connection.
 * @param failed Creates the error to throw, from the error of the connection or a {@link SilenceError}.
 */
export async function* chunksOf(
  { body }: Response,
  failed: (cause: unknown) => unknown = (cause) => cause,
): AsyncGenerator<Uint8Array, void> {
  const reader = body?.getReader();
  let [waited, arrived] = [0, 0];
  try {
    while (reader) {
      const start = performance.now();
      const { done, value } = await inTime(reader.read(), SILENCE_MS - waited).catch((cause: unknown) => {
        throw failed(cause);
      });
      if (done) return;
      waited += performance.now() - start;
      arrived += value.length;
      if (arrived >= SILENCE_BYTES) [waited, arrived] = [0, 0];
      yield value;
    }
  } finally {
    void reader?.cancel().catch(() => undefined);
  }
}

/**
 * Reads the whole body of a response. Rejects with the errors that {@link chunksOf} throws. @param maxBytes Maximum
 * length; a longer body rejects with a RangeError.
 */
export async function bytesOf(
  response: Response,
  failed?: (cause: unknown) => unknown,
  maxBytes = Infinity,
): Promise<Uint8Array<ArrayBuffer>> {
  const chunks: Uint8Array[] = [];
  let length = 0;
  for await (const chunk of chunksOf(response, failed)) {
    length += chunk.length;
    if (length > maxBytes) throw new RangeError(`more than ${maxBytes} bytes`);
    chunks.push(chunk);
  }
  return concatenated(Uint8Array, chunks);
}

/** Returns a new array of a type with the elements of all parts, in their order. */
export function concatenated<T extends Uint8Array | Uint32Array | Int32Array | Float32Array>(
  Numbers: new (length: number) => T,
  parts: readonly ArrayLike<number>[],
): T {
  const all = new Numbers(parts.reduce((sum, { length }) => sum + length, 0));
  let at = 0;
  for (const part of parts) {
    all.set(part, at);
    at += part.length;
  }
  return all;
}

function inTime<T>(reading: Promise<T>, ms: number): Promise<T> {
  let timer: ReturnType<typeof setTimeout> | undefined;
  const silence = new Promise<never>((_, reject) => {
    timer = setTimeout(() => reject(new SilenceError()), ms);
  });
  return Promise.race([reading, silence]).finally(() => clearTimeout(timer));
}
