/** Reads manifests of streamed scenes. The worker loads this module for the first streamed scene. */
import { GaussianSplatError } from '@gaussian-splat/core';
import { creditsOf, fetchScene, LoadBudget, parseJson } from '@gaussian-splat/formats';
import { checkManifest, type DetailManifest } from '@gaussian-splat/renderer';
import { fileName, named, throttled } from './load-helpers.js';
import type { FileRequest, TaskListeners } from './protocol.js';

export { decodePage } from '@gaussian-splat/renderer/tools';

/**
 * Maximum size of a manifest in bytes. It has about 50 bytes for each file of 5 pages, and its parsed content is copied
 * to the main thread.
 */
const MAX_BYTES = 1 << 24;
/** CPU memory of a page that is not loaded, bytes. */
const PAGE_BYTES = 128;

/**
 * Fetches and validates the manifest of a streamed scene, a `detail.json`. Throws GaussianSplatError (`network/*`,
 * `decode/*`, `out-of-memory/*`), or the signal's reason if that is aborted.
 */
export async function openManifest(
  { url, credentials, limits = {} }: FileRequest,
  signal: AbortSignal,
  { onProgress }: Pick<TaskListeners, 'onProgress'>,
): Promise<DetailManifest> {
  try {
    const { maxBytes, maxSeconds, maxSplats = Infinity } = limits;
    const report = throttled(onProgress);
    const bytes = await fetchScene(url, {
      mode: 'cors',
      credentials,
      signal,
      onProgress: report,
      maxBytes,
      maxSeconds,
    });
    const budget = new LoadBudget(bytes.length, limits);
    const json = parseJson({ bytes, name: url, budget }, MAX_BYTES);
    const manifest = checkManifest(json, url, Math.floor(budget.allowed / PAGE_BYTES));
    if (manifest.splats > maxSplats) throw tooMany(url, manifest.splats, maxSplats);
    return { ...manifest, ...creditsOf(manifest) };
  } catch (error) {
    signal.throwIfAborted();
    throw named(error, fileName(url));
  }
}

const tooMany = (where: string, splats: number, max: number): GaussianSplatError =>
  new GaussianSplatError('out-of-memory/budget', {
    where,
    expected: `at most ${max} splats`,
    found: String(splats),
    remedy: 'use a smaller scene, or raise the limit',
  });
