/** A streamed scene whose folder lies in memory. */
import type { GaussianCloud, Vector3 } from '@gaussian-splat/core';
import type { DetailManifest } from '@gaussian-splat/renderer';
import {
  buildDetailTree,
  codingFor,
  writePages,
  type DetailTreeOptions,
  type PageSteps,
} from '@gaussian-splat/optimize/pages';

export interface DetailFolder {
  readonly manifest: DetailManifest;
  readonly files: ReadonlyMap<string, ArrayBuffer>;
  /** As `StreamOptions.fetchPage`, not decoded. */
  readonly fetchPage: (file: string) => Promise<ArrayBuffer>;
}

export interface DetailFolderOptions extends DetailTreeOptions {
  /** Files are coded with these steps; by `deflate`, which not every place has. */
  readonly coded?: { readonly steps: PageSteps; readonly deflate: (bytes: Uint8Array) => Uint8Array };
}

/** The folder of a cloud, or of copies of it. */
export function detailFolder(
  cloud: GaussianCloud,
  places?: readonly Vector3[],
  { coded, ...options }: DetailFolderOptions = {},
): DetailFolder {
  const files = new Map<string, ArrayBuffer>();
  const tree = buildDetailTree(cloud, options);
  const manifest = writePages(tree, {
    coded: coded && { coding: codingFor(coded.steps, tree), deflate: coded.deflate },
    places,
    put: (path, bytes) => files.set(path, bytes.buffer),
  });
  return { manifest, files, fetchPage: (file) => Promise.resolve(files.get(file)!.slice(0)) };
}
