/** A streamed scene whose folder lies in memory. */
import type { GaussianCloud, Vector3 } from '@gaussian-splat/core';
import type { DetailManifest } from '@gaussian-splat/renderer';
import {
  buildDetailTree,
  codingOf,
  cutPages,
  manifestOf,
  PageEncoder,
  packPage,
  treeOfCopies,
  type BuiltPage,
  type DetailTree,
  type DetailTreeOptions,
  type PageSteps,
} from '@gaussian-splat/economise/pages';

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
  const coding = coded && codingOf(coded.steps);
  const write = (from: DetailTree) => {
    const encoder = coding && new PageEncoder(from, coding, coded);
    return (page: BuiltPage): ArrayBuffer => (encoder ? encoder.encode(page) : packPage(from, page)).buffer;
  };
  const tree = buildDetailTree(cloud, options);
  const pages = cutPages(tree, places === undefined);
  const files = new Map<string, ArrayBuffer>();
  const writePart = write(tree);
  pages.forEach((page, p) => files.set(`part-${p}`, writePart(page)));
  const fetchPage = (file: string): Promise<ArrayBuffer> => Promise.resolve(files.get(file)!.slice(0));
  const part = manifestOf(tree, pages, (p) => `part-${p}`, coding);
  if (places === undefined) return { manifest: part, files, fetchPage };
  const above = treeOfCopies(tree, places);
  const abovePages = cutPages(above);
  const writeTop = write(above);
  abovePages.forEach((page, p) => files.set(`top-${p}`, writeTop(page)));
  const top = manifestOf(above, abovePages, (p) => `top-${p}`, coding);
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
