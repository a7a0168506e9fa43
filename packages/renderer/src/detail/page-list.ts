import type { Vector3 } from '@gaussian-splat/core';
import { PAGE_CHUNKS, type DetailManifest } from './manifest.js';

/** Stands for no page. */
export const NONE = 0xffffffff;

/** The pages of a streamed scene, parents before children. */
export interface PageList {
  readonly count: number;
  /** [P] slots that a page takes, one for each {@link PAGE_CHUNKS} chunks. */
  readonly slots: Uint32Array;
  /** [P] chunks of a page; those of a run are fewer if some of its splats cannot be drawn. */
  readonly chunks: Uint32Array;
  /** [P] how many of them have their parent in another page or none. */
  readonly upper: Uint32Array;
  /** [P] page that holds the chunks above, or {@link NONE}, the first of these chunks in it and their number. */
  readonly parent: Uint32Array;
  readonly parentChunk: Uint32Array;
  readonly parentChunks: Uint32Array;
  /** [P] where a page's chunks begin in {@link children}. */
  readonly firstChunk: Uint32Array;
  /** Page that holds what each chunk stands for, or {@link NONE}; {@link PAGE_CHUNKS} for each slot. */
  readonly children: Uint32Array;
}

/** The pages of all instances of a scene, numbered through. */
export interface InstanceList extends PageList {
  readonly file: (page: number) => string;
  readonly translate: (page: number) => Vector3;
  /** [P] number of the first page of a page's instance. */
  readonly first: Uint32Array;
}

/** Pages of so many slots each, none of which is below another yet. */
export function emptyList(slots: Uint32Array): PageList {
  const count = slots.length;
  const firstChunk = new Uint32Array(count);
  let chunks = 0;
  for (let page = 0; page < count; page++) {
    firstChunk[page] = chunks;
    chunks += PAGE_CHUNKS * slots[page];
  }
  return {
    ...{ count, slots, firstChunk, chunks: new Uint32Array(count), upper: new Uint32Array(count) },
    ...{ parent: new Uint32Array(count).fill(NONE), parentChunk: new Uint32Array(count) },
    ...{ parentChunks: new Uint32Array(count), children: new Uint32Array(chunks).fill(NONE) },
  };
}

/** Puts a page below some chunks of an earlier one. */
export function putBelow(list: PageList, page: number, parent: number, firstChunk: number, chunks: number): void {
  list.parent[page] = parent;
  list.parentChunk[page] = firstChunk;
  list.parentChunks[page] = chunks;
  const from = list.firstChunk[parent] + firstChunk;
  list.children.fill(page, from, from + chunks);
}

/** Numbers of the pages below the chunks of a page that are in one of its slots, {@link NONE} where there is none. */
export function childrenIn(list: PageList, page: number, slot: number): Uint32Array {
  const from = list.firstChunk[page] + PAGE_CHUNKS * slot;
  return list.children.subarray(from, from + Math.min(PAGE_CHUNKS, list.chunks[page] - PAGE_CHUNKS * slot));
}

/** [P] 1 for pages that with all that is above them take more than so many slots. */
export function largerThan(most: number, { count, slots, parent }: PageList): Uint8Array {
  const withAbove = new Float64Array(count);
  for (let page = 0; page < count; page++) {
    withAbove[page] = slots[page] + (parent[page] === NONE ? 0 : withAbove[parent[page]]);
  }
  return Uint8Array.from(withAbove, (needed) => (needed > most ? 1 : 0));
}

export function listPages({ trees, instances }: DetailManifest): InstanceList {
  const count = instances.reduce((sum, { tree }) => sum + trees[tree].pages.length, 0);
  const list = { ...emptyList(new Uint32Array(count).fill(1)), first: new Uint32Array(count) };
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
      putBelow(list, page, above[0], above[1], 1);
    });
    first += trees[instance.tree].pages.length;
  });
  return {
    ...list,
    file: (page) => trees[instances[instanceOf[page]].tree].pages[page - list.first[page]].file,
    translate: (page) => instances[instanceOf[page]].translate,
  };
}
