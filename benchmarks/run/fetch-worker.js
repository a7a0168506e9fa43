/** Fetches files for a page that measures, and decodes those that are coded, as the element's worker does: reading a response costs its thread more than all else that a page of a streamed scene does. */
import { decodePage } from '@gaussian-splat/renderer/tools';

const running = new Map();

async function answer({ id, url, coded }) {
  const abort = new AbortController();
  running.set(id, abort);
  try {
    const response = await fetch(url, { signal: abort.signal });
    if (!response.ok) throw new Error(`${url}: HTTP ${response.status}`);
    const received = await response.arrayBuffer();
    const length = received.byteLength;
    const bytes = coded ? await decodePage(url, new Uint8Array(received), coded) : received;
    postMessage({ id, bytes, length }, [bytes]);
  } catch (error) {
    if (!abort.signal.aborted) postMessage({ id, error: String(error) });
  } finally {
    running.delete(id);
  }
}

addEventListener('message', ({ data }) => {
  if (data.url === undefined) running.get(data.id)?.abort();
  else void answer(data);
});
