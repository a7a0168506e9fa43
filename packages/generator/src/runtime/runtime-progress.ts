import type { ProgressListener } from './fetch-bytes.js';

/**
 * Bytes of the runtime's WebAssembly, onnxruntime-web 1.30.0: known before it is asked for, and also where a server that compresses does not tell
 * the length. Its script, under 1 % of that, is not counted.
 */
export const WASM_BYTES = { jspi: 16_758_545, asyncify: 26_781_914 } as const;

/** The build for browsers that can suspend WebAssembly (JSPI), or the larger one for all others. */
export const wasmBuild = (): keyof typeof WASM_BYTES => ('Suspending' in WebAssembly ? 'jspi' : 'asyncify');

const listeners = new Set<ProgressListener>();
/** Undefined before the runtime is asked for, null once all of it is there. */
let state: readonly [loaded: number, total: number] | null | undefined;

/** The runtime's bytes so far. @param progress null for the end of it, undefined if it could not be had */
export function noteRuntimeBytes(progress: typeof state): void {
  state = progress;
  for (const listener of listeners) tell(listener);
  if (progress === null) listeners.clear();
}

/**
 * Tells how much of the runtime has arrived, now and whenever more has. A runtime that is there already counts as no bytes: nobody waits for them.
 * @returns ends it.
 */
export function watchRuntimeBytes(listener: ProgressListener): () => void {
  if (state === null) {
    listener(0, 0);
    return () => undefined;
  }
  listeners.add(listener);
  tell(listener);
  return () => listeners.delete(listener);
}

function tell(listener: ProgressListener): void {
  const total = state?.[1] ?? WASM_BYTES[wasmBuild()];
  listener(state === null ? total : (state?.[0] ?? 0), total);
}
