/** Starts helping workers. The module is loaded only for scenes that several workers pack. */
import type { PageMessage, WorkerMessage } from './worker-messages.js';

/** Number of threads that helpers leave free: the worker that is helped, the main thread, and one for the network. */
const OTHERS = 3;
/** Maximum number of helpers. More helpers would wait for the worker that distributes the rows. */
const MAX_HELPERS = 4;

/**
 * Starts workers that pack rows of a scene for another worker.
 * @param worker The worker that is helped.
 * @param id Number of the load that they help with.
 * @param max Maximum number of helpers.
 * @returns A function that terminates the helpers.
 */
export function startHelpers(worker: Worker, id: number, max: number, spawn: () => Worker): () => void {
  const { hardwareConcurrency = 2 } = navigator;
  const count = Math.max(0, Math.min(max, MAX_HELPERS, hardwareConcurrency - OTHERS));
  const helpers = Array.from({ length: count }, () => {
    const helper = spawn();
    helper.addEventListener(
      'message',
      ({ data }: MessageEvent<WorkerMessage>) => {
        if (data.type !== 'ready') return;
        const { port1, port2 } = new MessageChannel();
        helper.postMessage({ type: 'pack', port: port1 } satisfies PageMessage, [port1]);
        worker.postMessage({ type: 'helper', id, port: port2 } satisfies PageMessage, [port2]);
      },
      { once: true },
    );
    // If a helper does not start, the others do its work.
    helper.addEventListener('error', (event) => event.preventDefault());
    return helper;
  });
  return () => helpers.forEach((helper) => helper.terminate());
}
