import { spawnAt } from './spawn-worker.js';

/**
 * Ways to start the worker, instead of worker-sources.ts, in the CDN build. The worker's script is in the folder of the
 * element's script, and loads its readers from there.
 */
export const WORKER_SOURCES: readonly (() => Worker)[] = [
  (): Worker => spawnAt(new URL('./scene-worker.js', import.meta.url)),
];
