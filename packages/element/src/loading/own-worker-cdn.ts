import { spawnAt } from './spawn-worker.js';

/** The CDN build in place of own-worker.ts: the worker's script lies beside the element's, and finds its readers beside itself. */
export const OWN_WORKERS: readonly (() => Worker)[] = [
  (): Worker => spawnAt(new URL('./scene-worker.js', import.meta.url)),
];
