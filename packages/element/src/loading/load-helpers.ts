/** Functions that all loads use: for file names, progress and errors. */
import { GaussianSplatError } from '@gaussian-splat/core';
import { outOfMemory } from '@gaussian-splat/formats';
import type { ProgressListener } from './protocol.js';

/** Minimum interval between progress reports, ms, because thousands of chunks may arrive. */
const PROGRESS_INTERVAL_MS = 50;

/**
 * Returns the last segment of the URL's path. It is the file name in messages, and its extension identifies formats
 * without a signature. A `blob:` URL has no name, so its fragment is used: a page can append `#plant.splat`.
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

/**
 * Returns a listener that passes on at most one report per {@link PROGRESS_INTERVAL_MS}. A report of a complete file whose
 * size is known is always passed on.
 */
export function throttled(onProgress: ProgressListener): ProgressListener {
  let last = -Infinity;
  return (loaded, total) => {
    const now = performance.now();
    if (loaded !== total && now - last < PROGRESS_INTERVAL_MS) return;
    last = now;
    onProgress(loaded, total);
  };
}

/**
 * Returns an error with a code. Errors without one are failed allocations, or internal faults that the file triggers.
 */
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
