/** Files by way of a worker: see fetch-worker.js. */
import { within } from './bounded.js';

/**
 * @param seconds that one file may take
 * @returns a function that gets an address, a signal, and how a page is coded that is to be decoded, and resolves to the bytes and how many were received; rejects with what went wrong, or the signal's reason
 */
export function startFetching(seconds) {
  const worker = new Worker(new URL('run/fetch-worker.js', location.href));
  const pending = new Map();
  let next = 0;
  worker.addEventListener('message', ({ data: { id, bytes, length, error } }) => {
    const { resolve, reject } = pending.get(id) ?? {};
    if (error === undefined) resolve?.({ bytes, length });
    else reject?.(new Error(error));
  });
  return async (url, signal, coded) => {
    const id = next++;
    const answered = new Promise((resolve, reject) => pending.set(id, { resolve, reject }));
    const cancel = () => pending.get(id)?.reject(signal.reason);
    signal.addEventListener('abort', cancel, { once: true });
    worker.postMessage({ id, url: String(url), coded });
    try {
      return await within(seconds, url, answered);
    } catch (error) {
      worker.postMessage({ id });
      throw error;
    } finally {
      signal.removeEventListener('abort', cancel);
      pending.delete(id);
    }
  };
}
