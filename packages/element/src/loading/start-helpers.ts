/** Loaded only for scenes that several workers pack. */
import type { PageMessage, WorkerMessage } from './protocol.js';

/** Threads that are left alone: the page's own, and that of the worker that is helped. */
const OTHERS = 2;
/** Workers that help at most. More would wait for the one that hands out the shares. */
const MOST_HELPERS = 7;

/**
 * Starts workers that pack shares of a scene for another one.
 * @param id the load that they help with
 * @param most so many of them at most
 * @returns ends them
 */
export function startHelpers(worker: Worker, id: number, most: number, spawn: () => Worker): () => void {
  const { hardwareConcurrency = 2 } = navigator;
  const count = Math.min(most, MOST_HELPERS, Math.max(1, hardwareConcurrency - OTHERS));
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
    // One that does not come, or ends, is missed by nobody: what it was to do is done by the others.
    helper.addEventListener('error', (event) => event.preventDefault());
    return helper;
  });
  return () => helpers.forEach((helper) => helper.terminate());
}
