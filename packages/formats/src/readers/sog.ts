import { GaussianSplatError, type GaussianCloud } from '@gaussian-splat/core';
import type { SceneSource } from '../scene-format.js';
import { parseSogMeta } from '../sog/meta.js';
import { readSogImages } from '../sog/read-sog.js';

/** Matches the file name at the end of a path or URL. */
const LAST_PART = /[^/]*$/;

/**
 * Reads a SOG scene of PlayCanvas, version 1 or 2, from its `meta.json`. Its attributes are quantized to pixels of
 * lossless WebP images, and coefficients above the constant one are in a palette. Bundles (`.sog`) are ZIP files, which
 * `readers/zip.ts` opens.
 */
export async function readSog(source: SceneSource): Promise<GaussianCloud> {
  const meta = parseSogMeta(source);
  return readSogImages(meta, source.openFile ?? noParts(source.name), source);
}

/**
 * Returns a substitute for `openFile` that rejects with `decode/unsupported`, for a scene whose other files cannot be
 * opened.
 * @param packed Name of a file that could contain the whole scene, for the remedy.
 */
export function noParts(name: string, packed = 'scene.sog'): (path: string) => Promise<never> {
  return (path) =>
    Promise.reject(
      new GaussianSplatError('decode/unsupported', {
        where: `${name}, ${path}`,
        expected: 'a way to open the other files of the scene',
        found: 'only this one file',
        remedy: `load it by its address, or pack the folder into one file, ${name.replace(LAST_PART, packed)}`,
      }),
    );
}
