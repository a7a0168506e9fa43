/** The worker's code as text, a module for each chunk: `npm run build` makes it of scene-worker.js. */

export interface Chunk {
  /** Chunks that must be there before. */
  readonly needs: readonly string[];
  readonly load: () => Promise<{ readonly default: string }>;
}

/** By the names by which the code asks for them. */
export const CHUNKS: Readonly<Record<string, Chunk>>;
