/** Common parts of all loads: names, progress and errors. */
import { GaussianSplatError } from '@gaussian-splat/core';
import { outOfMemory } from '@gaussian-splat/formats';
import type { ProgressListener } from './protocol.js';

/** Minimum interval of progress reports in ms, because chunks may arrive by the thousand. */
const PROGRESS_INTERVAL_MS = 50;

/**
 * Last segment of the URL's path: the file name for users, whose extension identifies formats without a signature. A
 * `blob:` URL has no name of its own; its fragment is used, so that a page can append `#plant.splat`.
 */
export function fileName(url: string): string {
  if (!URL.canParse(url) || url.startsWith('data:')) return url.slice(0, 80);
  const { protocol, pathname, hash } = new URL(url);
  const name = protocol === 'blob:' && hash !== '' ? hash.slice(1) : (pathname.split('/').pop() ?? '');
  return decodeURIComponentSafely(name) || url;
}

function decodeURIComponentSafely(text: string): string {
  try {
    return decodeURIComponent(text);
  } catch {
    return text;
  }
}

/** Passes the first and the last report and limits those between. */
export function throttled(onProgress: ProgressListener): ProgressListener {
  let last = -Infinity;
  return (loaded, total) => {
    const now = performance.now();
    if (loaded !== total && now - last < PROGRESS_INTERVAL_MS) return;
    last = now;
    onProgress(loaded, total);
  };
}

/** Converts errors without a code: failed allocations, or an internal bug that the file triggers. */
export function named(error: unknown, where: string): GaussianSplatError {
  if (error instanceof GaussianSplatError) return error;
  const memory = outOfMemory(error, where);
  if (memory) return memory;
  return new GaussianSplatError('decode/corrupt', {
    where,
    expected: 'a scene that can be read',
    found: error instanceof Error ? `${error.name}: ${error.message}` : String(error),
    remedy: 'check the file in another viewer; if it opens there, report it with this message',
    cause: error,
  });
}
