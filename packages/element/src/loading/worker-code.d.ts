/**
 * The worker's code as text, with one module for each chunk. `npm run build` generates the module from scene-worker.js.
 */

export interface Chunk {
  /** Names of the chunks that the worker must have before this one. */
  readonly needs: readonly string[];
  readonly load: () => Promise<{ readonly default: string }>;
}

/** Chunks by the names by which the worker's code requests them. */
export const CHUNKS: Readonly<Record<string, Chunk>>;
