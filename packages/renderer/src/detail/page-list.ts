import type { Vector3 } from '@gaussian-splat/core';
import { PAGE_CHUNKS, type DetailManifest } from './manifest.js';

/** Stands for no page. */
export const NONE = 0xffffffff;

/** The pages of all instances of a scene, numbered through. */
export interface PageList {
  readonly count: number;
  readonly file: (page: number) => string;
  readonly translate: (page: number) => Vector3;
  /** [P] number of the first page of a page's instance. */
  readonly first: Uint32Array;
  /** [P] chunks of a page. */
  readonly chunks: Uint8Array;
  /** [P] how many of them have their parent in another page or none. */
  readonly upper: Uint8Array;
  /** [P] page that holds the chunk above, or {@link NONE}, and the number of that chunk in it. */
  readonly parent: Uint32Array;
  readonly parentChunk: Uint8Array;
  /** [P, 20] page that holds what each chunk stands for, or {@link NONE}. */
  readonly children: Uint32Array;
}

export function listPages({ trees, instances }: DetailManifest): PageList {
  const count = instances.reduce((sum, { tree }) => sum + trees[tree].pages.length, 0);
  const list = {
    ...{
      first: new Uint32Array(count),
      chunks: new Uint8Array(count),
      upper: new Uint8Array(count),
      parentChunk: new Uint8Array(count),
    },
    ...{ parent: new Uint32Array(count).fill(NONE), children: new Uint32Array(PAGE_CHUNKS * count).fill(NONE) },
  };
  const instanceOf = new Uint32Array(count);
  let first = 0;
  instances.forEach((instance, i) => {
    trees[instance.tree].pages.forEach(({ chunks, upper, parent }, p) => {
      const page = first + p;
      instanceOf[page] = i;
      list.first[page] = first;
      list.chunks[page] = chunks;
      list.upper[page] = upper;
      const above = parent ? [first + parent[0], parent[1]] : instance.parent;
      if (above === undefined) return;
      list.parent[page] = above[0];
      list.parentChunk[page] = above[1];
      list.children[PAGE_CHUNKS * above[0] + above[1]] = page;
    });
    first += trees[instance.tree].pages.length;
  });
  return {
    count,
    ...list,
    file: (page) => trees[instances[instanceOf[page]].tree].pages[page - list.first[page]].file,
    translate: (page) => instances[instanceOf[page]].translate,
  };
}
