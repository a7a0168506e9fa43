/** What all loads share: names, progress and errors. */
import { GaussianSplatError } from '@gaussian-splat/core';
import { outOfMemory } from '@gaussian-splat/formats';
import type { ProgressListener } from './protocol.js';

/** Milliseconds between two progress reports: chunks may arrive by the thousand. */
const PROGRESS_INTERVAL_MS = 50;

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
