import { fetchScene } from '@gaussian-splat/formats';
import type { FileRequest } from './protocol.js';

/**
 * The bytes of one file, in a buffer of their own, or the words of coded pages. Throws GaussianSplatError (`network/*`, `decode/*`), or the signal's reason once that is aborted.
 */
export async function fetchFile(
  { url, credentials, limits, coded }: FileRequest,
  signal: AbortSignal,
): Promise<ArrayBuffer> {
  const { maxBytes, maxSeconds } = limits ?? {};
  const bytes = await fetchScene(url, { mode: 'cors', credentials, signal, maxBytes, maxSeconds });
  if (coded === undefined) return bytes.slice().buffer;
  // What read the manifest is there already.
  return (await import('./open-manifest.js')).decodePage(url, bytes as Uint8Array<ArrayBuffer>, coded);
}
