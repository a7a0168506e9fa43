/** Fetching, reading and packing one scene: what runs in the worker, or on the page where workers are refused. */
import { boundsOf, GaussianSplatError, loadModule, type GaussianCloud } from '@gaussian-splat/core';
import { fetchScene, isSequence, openPartAt, readScene, type FetchSceneOptions } from '@gaussian-splat/formats';
import { packGaussians } from '@gaussian-splat/renderer';
import { PreviewSchedule } from './preview-schedule.js';
import { ProgressSum } from './progress-sum.js';
import type { LoadedScene, LoadedSequence, PreviewListener, ProgressListener, SceneRequest } from './protocol.js';

/** Milliseconds between two progress reports: chunks may arrive by the thousand. */
const PROGRESS_INTERVAL_MS = 50;

/**
 * Loads one scene, or the manifest of several. Throws GaussianSplatError (`network/*`, `decode/*`, `out-of-memory/allocation`), or the signal's
 * reason once that is aborted.
 */
export async function loadScene(
  request: SceneRequest,
  signal: AbortSignal,
  onProgress: ProgressListener,
  onPreview?: PreviewListener,
): Promise<LoadedScene | LoadedSequence> {
  try {
    const { url, credentials } = request;
    const name = fileName(url);
    const progress = new ProgressSum(throttled(onProgress), mayHaveParts(name));
    const options = (): FetchSceneOptions => ({ mode: 'cors', credentials, signal, onProgress: progress.add() });
    const pack = (cloud: GaussianCloud): LoadedScene => ({
      packed: packGaussians(cloud, { sh: request.sh }),
      bounds: { ...boundsOf(cloud), up: cloud.hints?.up },
    });
    const previews = onPreview && new PreviewSchedule(name, signal, (cloud) => onPreview(pack(cloud)));
    const bytes = await fetchScene(url, { ...options(), onArrival: previews?.onArrival });
    if (isSequence(bytes)) {
      const { sequenceOf } = await loadModule('the code that reads sequences', () => import('./sequence-of.js'));
      return sequenceOf(bytes, name, url);
    }
    // Nothing lies beside what has no place.
    const openPart = /^(blob|data):/.test(url) ? undefined : openPartAt(url, options);
    const level = request.levels ? 'all' : 0;
    const cloud = await readScene(bytes, { name, signal, openPart, level, onPreview: previews?.onPreview });
    signal.throwIfAborted();
    if (cloud.levelRuns === undefined) return pack(cloud);
    const { packLevels } = await loadModule('the code that packs levels of detail', () => import('./pack-levels.js'));
    return packLevels(cloud, request.sh);
  } catch (error) {
    signal.throwIfAborted();
    throw named(error, fileName(request.url));
  }
}

/**
 * Last part of the URL's path: what people call the file, and whose extension tells formats without a signature. A `blob:`
 * URL has no name of its own; there the fragment is taken, so that a page can say `${objectUrl}#plant.splat`.
 */
export function fileName(url: string): string {
  if (!URL.canParse(url) || url.startsWith('data:')) return url.slice(0, 80);
  const { protocol, pathname, hash } = new URL(url);
  const name = protocol === 'blob:' && hash !== '' ? hash.slice(1) : (pathname.split('/').pop() ?? '');
  return decodeURIComponentSafely(name) || url;
}

/** True where the file that the address names is the smaller part of the scene. */
function mayHaveParts(name: string): boolean {
  return /\.(json|gltf)$/i.test(name);
}

function decodeURIComponentSafely(text: string): string {
  try {
    return decodeURIComponent(text);
  } catch {
    return text;
  }
}

/** Lets the first and the last report through and few of those between. */
export function throttled(onProgress: ProgressListener): ProgressListener {
  let last = -Infinity;
  return (loaded, total) => {
    const now = performance.now();
    if (loaded !== total && now - last < PROGRESS_INTERVAL_MS) return;
    last = now;
    onProgress(loaded, total);
  };
}

/** Errors that no reader named: memory that was not to be had, or a fault of ours that the file brought to light. */
export function named(error: unknown, where: string): GaussianSplatError {
  if (error instanceof GaussianSplatError) return error;
  if (error instanceof RangeError) {
    return new GaussianSplatError('out-of-memory/allocation', {
      where,
      expected: 'memory enough to unpack the scene',
      found: error.message,
      remedy: 'use a smaller scene, or close other pages',
      cause: error,
    });
  }
  return new GaussianSplatError('decode/corrupt', {
    where,
    expected: 'a scene that can be read',
    found: error instanceof Error ? `${error.name}: ${error.message}` : String(error),
    remedy: 'check the file in another viewer; if it opens there, report it with this message',
    cause: error,
  });
}
