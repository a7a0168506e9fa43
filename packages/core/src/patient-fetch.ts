/**
 * Milliseconds without a response after which a server is abandoned, and a connection with less than 1 KiB counts as
 * broken.
 */
export const SILENCE_MS = 30_000;
const SILENCE_BYTES = 1024;

/** A server or connection that sent too little data within {@link PATIENCE_MS}. */
export class SilenceError extends Error {
  constructor() {
    super(`nothing came for ${SILENCE_MS / 1000} s`);
  }
}

/** Same as `fetch`, but also rejects with a {@link SilenceError} if no headers arrive in time. */
export async function fetchPatiently(url: string | URL, { signal, ...init }: RequestInit = {}): Promise<Response> {
  const silence = new AbortController();
  const timer = setTimeout(() => silence.abort(new SilenceError()), SILENCE_MS);
  const either = signal ? AbortSignal.any([signal, silence.signal]) : silence.signal;
  try {
    return await fetch(url, { ...init, signal: either });
  } catch (error) {
    signal?.throwIfAborted();
    throw silence.signal.aborted ? silence.signal.reason : error;
  } finally {
    clearTimeout(timer);
  }
}

/**
 * Iterates over the chunks of a body. Ending the loop early closes the connection.
 * @param failed Creates the error to throw from the error of the connection or of its silence.
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

/** Reads a whole body. Rejects as {@link chunksOf} throws. @param maxBytes A longer body rejects with a RangeError. */
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
  const bytes = new Uint8Array(length);
  let at = 0;
  for (const chunk of chunks) {
    bytes.set(chunk, at);
    at += chunk.length;
  }
  return bytes;
}

function inTime<T>(reading: Promise<T>, ms: number): Promise<T> {
  let timer: ReturnType<typeof setTimeout> | undefined;
  const silence = new Promise<never>((_, reject) => {
    timer = setTimeout(() => reject(new SilenceError()), ms);
  });
  return Promise.race([reading, silence]).finally(() => clearTimeout(timer));
}
