import type { Vector3 } from '@gaussian-splat/core';
import type { DetailManifest } from '@gaussian-splat/renderer/tools';
import { cutPages, manifestOf, packPage, type BuiltPage, type DetailTree } from './build-pages.js';
import { PageEncoder, type PageEncoderOptions, type WrittenCoding } from './encode-page.js';
import { instancedTree } from './tile-tree.js';

/** Coding of the files of a folder, and options of their encoder. */
export interface FolderCoding extends PageEncoderOptions {
  readonly coding: WrittenCoding;
}

export interface PageFolderOptions {
  /** Coding of the files. By default, files contain the uncompressed words of the GPU. */
  readonly coded?: FolderCoding | undefined;
  /** Translations of copies of the scene, in an order with adjacent neighbors. By default, there is a single scene. */
  readonly places?: readonly Vector3[] | undefined;
  /** Stores a file at a path relative to the folder. */
  readonly put: (path: string, bytes: Uint8Array<ArrayBuffer>) => void;
}

/** Writes the pages of a scene or of copies of a scene. @returns The content of the manifest, `detail.json`. */
export function writePages(tree: DetailTree, { coded, places, put }: PageFolderOptions): DetailManifest {
  const write = (name: string, from: DetailTree, pages: readonly BuiltPage[], how = coded): DetailManifest => {
    const encoder = how && new PageEncoder(from, how.coding, how);
    const fileOf = (page: number): string => `pages/${name}-${String(page).padStart(5, '0')}.bin`;
    pages.forEach((page, p) =>
      put(fileOf(p), encoder ? encoder.encode(page) : new Uint8Array(packPage(from, page).buffer)),
    );
    return manifestOf(from, pages, fileOf, coded?.coding);
  };
  if (places === undefined) return write('scene', tree, cutPages(tree));
  const above = instancedTree(tree, places);
  const abovePages = cutPages(above);
  // The visibility of splats is not known for the tree above the copies.
  const top = write('top', above, abovePages, coded && { ...coded, seen: undefined });
  const part = write('part', tree, cutPages(tree, false));
  const parents = new Map<number, readonly [page: number, chunk: number]>();
  abovePages.forEach(({ holds }, page) =>
    holds.forEach(([level, copy], chunk) => level === 0 && parents.set(copy, [page, chunk])),
  );
  const copies = places.map((translate, copy) => ({ tree: 1, translate, parent: parents.get(copy) }));
  return { ...top, trees: [...top.trees, ...part.trees], instances: [...top.instances, ...copies] };
}

/**
 * Returns translations of columns × rows copies on the plane y = 0. Their order is a Z-order curve, so that neighbors have
 * the same parent.
 * @param spacing Distance between neighbors in units of the scene.
 */
export function placesOnGrid(columns: number, rows: number, spacing: number): Vector3[] {
  const code = (x: number, y: number): number => {
    let [bits, unit] = [0, 1];
    for (let bit = 0; bit < 12; bit++, unit *= 4) bits += unit * (((x >> bit) & 1) + 2 * ((y >> bit) & 1));
    return bits;
  };
  return Array.from({ length: columns * rows }, (_, i) => [i % columns, Math.floor(i / columns)] as const)
    .sort((a, b) => code(...a) - code(...b))
    .map(([x, y]) => [(x - (columns - 1) / 2) * spacing, 0, (y - (rows - 1) / 2) * spacing]);
}
