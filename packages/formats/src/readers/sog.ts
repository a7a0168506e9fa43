import { GaussianSplatError, type GaussianCloud } from '@gaussian-splat/core';
import type { SceneSource } from '../scene-format.js';
import { parseSogMeta } from '../sog/meta.js';
import { readSogImages } from '../sog/read-sog.js';

/** Matches `meta.json` and similar names; a query of the server stays. */
const LAST_PART = /[^/]*$/;

/**
 * Reads a SOG scene (PlayCanvas), versions 1 and 2, from its `meta.json`: attributes quantized into the pixels of
 * lossless WebP images, coefficients above the constant one in a palette. Bundles (`.sog`) are ZIP files, which
 * `readers/zip.ts` opens.
 */
export async function readSog(source: SceneSource): Promise<GaussianCloud> {
  const meta = parseSogMeta(source);
  return readSogImages(meta, source.openFile ?? noParts(source.name), source);
}

/**
 * Error for a description without its files.
 * @param packed Name of a file format that could hold the whole scene.
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
