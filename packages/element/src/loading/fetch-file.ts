import { fetchScene } from '@gaussian-splat/formats';
import type { FileRequest } from './protocol.js';

/**
 * The bytes of one file, in a buffer of their own. Throws GaussianSplatError (`network/*`), or the signal's reason once that is aborted.
 */
export async function fetchFile({ url, credentials, limits }: FileRequest, signal: AbortSignal): Promise<ArrayBuffer> {
  const { maxBytes, maxSeconds } = limits ?? {};
  const bytes = await fetchScene(url, { mode: 'cors', credentials, signal, maxBytes, maxSeconds });
  return bytes.slice().buffer;
}
