import { loadModule, type GaussianCloud } from '@gaussian-splat/core';
import { startsWith } from '../bytes.js';
import type { OpenPart, SceneSource } from '../scene-format.js';
import { parseSogMeta } from './meta.js';
import { readSogImages } from './read-sog.js';

/** Reads one SOG of a streamed scene: its `meta.json`, or a bundle of all of its files. @param open finds files beside it */
export async function readSogPart(source: SceneSource, open: OpenPart): Promise<GaussianCloud> {
  if (startsWith(source.bytes, 'PK\x03\x04')) {
    const { openBundle } = await loadModule('the code that reads bundles', () => import('../zip/bundle.js'));
    const bundle = openBundle(source);
    return readSogImages(parseSogMeta({ ...source, bytes: bundle.bytes }), bundle.open, source);
  }
  return readSogImages(parseSogMeta(source), open, source);
}
