import { loadModule, type GaussianCloud } from '@gaussian-splat/core';
import { startsWith } from '../bytes.js';
import type { OpenPart } from '../scene-format.js';
import { parseSogMeta } from './meta.js';
import { readSogImages } from './read-sog.js';

/** Reads one SOG of a streamed scene: its `meta.json`, or a bundle of all of its files. @param open finds files beside it */
export async function readSogPart(
  bytes: Uint8Array,
  name: string,
  open: OpenPart,
  signal: AbortSignal | undefined,
): Promise<GaussianCloud> {
  if (startsWith(bytes, 'PK\x03\x04')) {
    const { openBundle } = await loadModule('the code that reads bundles', () => import('../zip/bundle.js'));
    ({ bytes, open } = openBundle(bytes, name));
  }
  return readSogImages(parseSogMeta(bytes, name), open, { bytes, name, signal });
}
