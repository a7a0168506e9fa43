import type { ProgressListener } from './fetch-bytes.js';

/**
 * Bytes of the runtime's WebAssembly, onnxruntime-web 1.30.0: known before the request, and even if a server with
 * compression does not declare the length. Its script, under 1 % of that, is not counted.
 */
export const WASM_BYTES = { jspi: 16_758_545, asyncify: 26_781_914 } as const;

/** The build with JSPI, or the larger one for all other browsers. */
export const wasmBuild = (): keyof typeof WASM_BYTES => ('Suspending' in WebAssembly ? 'jspi' : 'asyncify');

const listeners = new Set<ProgressListener>();
/** Undefined before the request, null once the runtime is loaded. */
let state: readonly [loaded: number, total: number] | null | undefined;

/** Reports the received bytes of the runtime. @param progress null at the end, undefined after a failure. */
export function noteRuntimeBytes(progress: typeof state): void {
  state = progress;
  for (const listener of listeners) notify(listener);
  if (progress === null) listeners.clear();
}

/**
 * Reports the progress of the runtime, now and whenever more bytes arrive. A loaded runtime counts as no bytes, because
 * no one waits for them.
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
