/** Milliseconds after which a server that does not answer is given up, and a connection on which less than 1 KiB has arrived counts as broken. */
export const PATIENCE_MS = 30_000;
const PATIENCE_BYTES = 1024;

/** A server, or a connection, from which too little has arrived for {@link PATIENCE_MS}. */
export class SilenceError extends Error {
  constructor() {
    super(`nothing came for ${PATIENCE_MS / 1000} s`);
  }
}

/** As `fetch`. Rejects with a {@link SilenceError}, besides, if no headers arrive in time. */
export async function fetchPatiently(url: string | URL, { signal, ...init }: RequestInit = {}): Promise<Response> {
  const silence = new AbortController();
  const timer = setTimeout(() => silence.abort(new SilenceError()), PATIENCE_MS);
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
 * The pieces of a body. When the loop over them ends early, so does the connection.
 * @param failed makes the error that is thrown for what the connection, or the silence on it, gave as its cause
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
      const { done, value } = await inTime(reader.read(), PATIENCE_MS - waited).catch((cause: unknown) => {
        throw failed(cause);
      });
      if (done) return;
      waited += performance.now() - start;
      arrived += value.length;
      if (arrived >= PATIENCE_BYTES) [waited, arrived] = [0, 0];
      yield value;
    }
  } finally {
    void reader?.cancel().catch(() => undefined);
  }
}

/** A whole body. Rejects as {@link chunksOf} throws. @param maxBytes of a longer body it rejects with a RangeError */
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
