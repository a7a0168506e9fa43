/** Loaded by the worker when the first streamed scene is asked for. */
import { GaussianSplatError } from '@gaussian-splat/core';
import { fetchScene } from '@gaussian-splat/formats';
import { checkManifest, type DetailManifest } from '@gaussian-splat/renderer';
import { fileName, named, throttled } from './load-scene.js';
import type { FileRequest, ProgressListener } from './protocol.js';

export { decodePage } from '@gaussian-splat/renderer';

/** As of the index of streamed SOG. A page takes some 50 bytes. */
const MAX_BYTES = 1 << 26;

/**
 * Fetches and checks a `detail.json`. Throws GaussianSplatError (`network/*`, `decode/*`, `out-of-memory/allocation`), or the signal's reason once that is aborted.
 */
export async function openManifest(
  { url, credentials, limits = {} }: FileRequest,
  signal: AbortSignal,
  onProgress: ProgressListener,
): Promise<DetailManifest> {
  try {
    const { maxBytes, maxSeconds } = limits;
    const report = throttled(onProgress);
    const bytes = await fetchScene(url, {
      mode: 'cors',
      credentials,
      signal,
      onProgress: report,
      maxBytes,
      maxSeconds,
    });
    return checkManifest(parsed(bytes, url), url);
  } catch (error) {
    signal.throwIfAborted();
    throw named(error, fileName(url));
  }
}

function parsed(bytes: Uint8Array, where: string): unknown {
  if (bytes.length > MAX_BYTES) throw wrong(where, `${bytes.length} bytes of it`);
  try {
    return JSON.parse(new TextDecoder().decode(bytes));
  } catch (cause) {
    throw wrong(where, (cause as Error).message, cause);
  }
}

const wrong = (where: string, found: string, cause?: unknown): GaussianSplatError =>
  new GaussianSplatError('decode/header', {
    where,
    expected: `JSON that gaussian-splat detail wrote, of at most ${MAX_BYTES} bytes`,
    found,
    remedy: 'check the address, or write the folder again',
    cause,
  });
