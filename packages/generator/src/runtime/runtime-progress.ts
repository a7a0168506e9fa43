import type { ProgressListener } from './fetch-bytes.js';

/**
 * Bytes of the WebAssembly modules of onnxruntime-web 1.30.0, because servers that compress a file do not declare its
 * length. The script, which has less than 1 % of these bytes, is not counted.
 */
export const WASM_BYTES = { jspi: 16_758_545, asyncify: 26_781_914 } as const;

/** Returns the name of the build for this browser: with JSPI if the browser supports it, else the larger one. */
export const wasmBuild = (): keyof typeof WASM_BYTES => ('Suspending' in WebAssembly ? 'jspi' : 'asyncify');

const listeners = new Set<ProgressListener>();
/** Progress of the download; undefined before the request, null when the runtime is loaded. */
let state: readonly [loaded: number, total: number] | null | undefined;

/**
 * Reports the progress of the download to all listeners.
 * @param progress Received and total bytes; null at the end, undefined after a failure.
 */
export function noteRuntimeBytes(progress: typeof state): void {
  state = progress;
  for (const listener of listeners) notify(listener);
  if (progress === null) listeners.clear();
}

/**
 * Calls a listener with the progress of the runtime at once, and whenever more bytes arrive. A loaded runtime counts as
 * 0 bytes, because nothing is to be downloaded.
 * @returns A function that unsubscribes.
 */
export function watchRuntimeBytes(listener: ProgressListener): () => void {
  if (state === null) {
    listener(0, 0);
    return () => undefined;
  }
  listeners.add(listener);
  notify(listener);
  return () => listeners.delete(listener);
}

function notify(listener: ProgressListener): void {
  const total = state?.[1] ?? WASM_BYTES[wasmBuild()];
  listener(state === null ? total : (state?.[0] ?? 0), total);
}
