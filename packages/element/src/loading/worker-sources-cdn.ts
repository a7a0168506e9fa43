import { spawnAt } from './spawn-worker.js';

/**
 * Replaces worker-sources.ts in the CDN build: the worker's script is in the folder of the element's, and loads its readers
 * from there.
 */
export const WORKER_SOURCES: readonly (() => Worker)[] = [
  (): Worker => spawnAt(new URL('./scene-worker.js', import.meta.url)),
];
