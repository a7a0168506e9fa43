/** Loaded only for scenes that several workers pack. */
import type { PageMessage, WorkerMessage } from './protocol.js';

/** Threads that are not used: the main thread, and that of the worker that is helped. */
const OTHERS = 2;
/** Maximum number of helpers. More would wait for the worker that distributes the shards. */
const MAX_HELPERS = 7;

/**
 * Starts workers that pack shards of a scene for another one.
 * @param id The load that they help with.
 * @param most Maximum number of them.
 * @returns A function that ends them.
 */
export function startHelpers(worker: Worker, id: number, max: number, spawn: () => Worker): () => void {
  const { hardwareConcurrency = 2 } = navigator;
  const count = Math.min(max, MAX_HELPERS, Math.max(1, hardwareConcurrency - OTHERS));
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
    // The others take over the work of one that fails to start, or ends.
    helper.addEventListener('error', (event) => event.preventDefault());
    return helper;
  });
  return () => helpers.forEach((helper) => helper.terminate());
}
