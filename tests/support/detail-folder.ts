/** A streamed scene whose folder lies in memory. */
import type { GaussianCloud, Vector3 } from '@gaussian-splat/core';
import {
  buildDetailTree,
  cutPages,
  manifestOf,
  packPage,
  treeOfCopies,
  type DetailManifest,
  type DetailTreeOptions,
} from '@gaussian-splat/renderer';

export interface DetailFolder {
  readonly manifest: DetailManifest;
  readonly files: ReadonlyMap<string, ArrayBuffer>;
  /** As `StreamOptions.fetchPage`. */
  readonly fetchPage: (file: string) => Promise<ArrayBuffer>;
}

/** The folder of a cloud, or of copies of it. */
export function detailFolder(
  cloud: GaussianCloud,
  places?: readonly Vector3[],
  options: DetailTreeOptions = {},
): DetailFolder {
  const tree = buildDetailTree(cloud, options);
  const pages = cutPages(tree, places === undefined);
  const files = new Map<string, ArrayBuffer>();
  pages.forEach((page, p) => files.set(`part-${p}`, packPage(tree, page).buffer));
  const fetchPage = (file: string): Promise<ArrayBuffer> => Promise.resolve(files.get(file)!.slice(0));
  const part = manifestOf(tree, pages, (p) => `part-${p}`);
  if (places === undefined) return { manifest: part, files, fetchPage };
  const above = treeOfCopies(tree, places);
  const abovePages = cutPages(above);
  abovePages.forEach((page, p) => files.set(`top-${p}`, packPage(above, page).buffer));
  const top = manifestOf(above, abovePages, (p) => `top-${p}`);
  const parents = places.map((_, copy) => {
    const page = abovePages.findIndex(({ holds }) => holds.some(([level, chunk]) => level === 0 && chunk === copy));
    return [page, abovePages[page].holds.findIndex(([level, chunk]) => level === 0 && chunk === copy)] as const;
  });
  return {
    manifest: {
      ...top,
      trees: [...top.trees, ...part.trees],
      instances: [...top.instances, ...places.map((translate, c) => ({ tree: 1, translate, parent: parents[c] }))],
    },
    files,
    fetchPage,
  };
}
