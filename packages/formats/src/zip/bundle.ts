import { GaussianSplatError } from '@gaussian-splat/core';
import type { OpenFile, SceneSource } from '../scene-format.js';
import { Archive } from './archive.js';
import { listed, namedLike, relevant } from './paths.js';

/**
 * Returns the bytes of the `meta.json` in a SOG bundle, and a function that opens its images.
 * @throws GaussianSplatError `decode/unknown-format` if the bundle has no `meta.json`; errors of {@link Archive}
 */
export function openBundle(source: Pick<SceneSource, 'bytes' | 'name' | 'budget'>): {
  bytes: Uint8Array;
  open: OpenFile;
} {
  const archive = new Archive(source);
  const [path] = namedLike('meta.json', relevant(archive.paths));
  if (path === undefined) {
    throw new GaussianSplatError('decode/unknown-format', {
      where: source.name,
      expected: 'a SOG bundle, with a meta.json in it',
      found: `a ZIP archive with ${listed(archive.paths)}`,
      remedy: 'export the scene again; its index names another file than a SOG',
    });
  }
  const folder = path.slice(0, path.lastIndexOf('/') + 1);
  return { bytes: archive.open(path), open: async (part) => archive.open(folder + part) };
}
