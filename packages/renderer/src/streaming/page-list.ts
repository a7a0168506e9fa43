import type { Vector3 } from '@gaussian-splat/core';
import { SLOT_CHUNKS, type DetailManifest, type Tree, type TreePage } from './manifest.js';
import { NONE } from '../ranked-heap.js';

export { NONE };

/**
 * The pages of a streamed scene, P of them, parents before children. [P] denotes an array with one element for each
 * page.
 */
export interface PageList {
  /** Number of pages, P. */
  readonly count: number;
  /** Maximum of {@link count}, and length of the arrays of pages; undefined if the list does not grow. */
  readonly capacity?: number | undefined;
  /** Maximum number of slots of all pages; undefined if it is the sum of {@link slots}. */
  readonly maxSlots?: number | undefined;
  /** [P] number of slots of each page, one for each {@link SLOT_CHUNKS} chunks. */
  readonly slots: Uint32Array;
  /** [P] number of chunks of each page; a run of a level has fewer if some of its splats are unusable. */
  readonly chunks: Uint32Array;
  /** [P] number of the first chunks, whose parent is in another page or missing. */
  readonly upper: Uint32Array;
  /** [P] page that contains the parent chunks, or {@link NONE}. */
  readonly parent: Uint32Array;
  /** [P] index of the first parent chunk in that page. */
  readonly parentChunk: Uint32Array;
  /** [P] number of parent chunks, which are consecutive. */
  readonly parentChunks: Uint32Array;
  /** [P] index in {@link children} of the first chunk of each page. */
  readonly firstChunk: Uint32Array;
  /**
   * Index of the page that contains the children of each chunk, or {@link NONE}. Each slot has {@link SLOT_CHUNKS}
   * elements.
   */
  readonly children: Uint32Array;
}

/** Location of a page in the files of a folder. */
export interface PagePlace {
  readonly file: TreePage;
  /** Index in the file of the first chunk of the page. */
  readonly first: number;
  /** Number of chunks of the page. */
  readonly chunks: number;
}

/** The pages of all instances of a scene, numbered consecutively. The pages of the first instance are first. */
export interface InstanceList extends PageList {
  /** Returns the location of a page in the files of the folder. */
  readonly place: (page: number) => PagePlace;
  /** Returns the translation of a page in world units. */
  readonly translate: (page: number) => Vector3;
}

/** Returns a list of pages with these numbers of slots. Numbers of chunks are 0, and no page has a parent. */
export function emptyList(slots: Uint32Array): PageList {
  const count = slots.length;
  const firstChunk = new Uint32Array(count);
  let chunks = 0;
  for (let page = 0; page < count; page++) {
    firstChunk[page] = chunks;
    chunks += SLOT_CHUNKS * slots[page];
  }
  return {
    ...{ count, slots, firstChunk, chunks: new Uint32Array(count), upper: new Uint32Array(count) },
    ...{ parent: new Uint32Array(count).fill(NONE), parentChunk: new Uint32Array(count) },
    ...{ parentChunks: new Uint32Array(count), children: new Uint32Array(chunks).fill(NONE) },
  };
}

/** Makes a page the child of consecutive chunks of an earlier page. */
export function putBelow(list: PageList, page: number, parent: number, firstChunk: number, chunks: number): void {
  list.parent[page] = parent;
  list.parentChunk[page] = firstChunk;
  list.parentChunks[page] = chunks;
  const from = list.firstChunk[parent] + firstChunk;
  list.children.fill(page, from, from + chunks);
}

/** Returns the indices of the child pages of the chunks in a slot of a page; {@link NONE} for chunks without one. */
export function childrenIn(list: PageList, page: number, slot: number): Uint32Array {
  const from = list.firstChunk[page] + SLOT_CHUNKS * slot;
  return list.children.subarray(from, from + Math.min(SLOT_CHUNKS, list.chunks[page] - SLOT_CHUNKS * slot));
}

/**
 * A list of pages that grows while a scene is streamed. The chunks of a page and its children become known when the
 * page is fetched; before, it is assumed to have four times as many chunks as it replaces.
 */
export class GrowingList implements PageList {
  readonly capacity: number;
  readonly maxSlots: number;
  readonly slots: Uint32Array;
  readonly chunks: Uint32Array;
  readonly upper: Uint32Array;
  readonly parent: Uint32Array;
  readonly parentChunk: Uint32Array;
  readonly parentChunks: Uint32Array;
  readonly firstChunk: Uint32Array;
  #children = new Uint32Array(SLOT_CHUNKS).fill(NONE);
  /** Number of elements of {@link children} in use. */
  #used = 0;
  #count = 0;

  constructor(capacity: number, maxSlots: number) {
    const numbers = (): Uint32Array => new Uint32Array(capacity);
    [this.capacity, this.maxSlots] = [capacity, maxSlots];
    [this.slots, this.chunks, this.upper, this.firstChunk] = [numbers(), numbers(), numbers(), numbers()];
    [this.parent, this.parentChunk, this.parentChunks] = [numbers().fill(NONE), numbers(), numbers()];
  }

  get count(): number {
    return this.#count;
  }

  get children(): Uint32Array {
    return this.#children;
  }

  /** Appends a page below consecutive chunks of a page whose chunks are known. @returns Its index. */
  append(parent: number, firstChunk: number, chunks: number): number {
    const page = this.#count++;
    this.slots[page] = Math.ceil((4 * chunks) / SLOT_CHUNKS);
    putBelow(this, page, parent, firstChunk, chunks);
    return page;
  }

  /** Sets the number of chunks of a page. Appends the page if it is the first one. */
  measure(page: number, chunks: number): void {
    if (this.#count === 0) this.#count = 1;
    this.slots[page] = Math.ceil(chunks / SLOT_CHUNKS);
    this.chunks[page] = this.upper[page] = chunks;
    this.firstChunk[page] = this.#used;
    this.#used += SLOT_CHUNKS * this.slots[page];
    if (this.#used <= this.#children.length) return;
    const before = this.#children;
    this.#children = new Uint32Array(2 * this.#used).fill(NONE);
    this.#children.set(before);
  }
}

/** A page of a tree, and its parent: the index of the parent page in the tree, and of the chunk in that page. */
interface TreePart extends PagePlace {
  readonly parent?: readonly [part: number, chunk: number];
}

/** Returns the pages of a tree, and the index of the first page of each of its files. */
function partsOf({ pages }: Tree): { readonly parts: readonly TreePart[]; readonly firsts: readonly number[] } {
  const [parts, firsts]: [TreePart[], number[]] = [[], []];
  for (const file of pages) {
    const { chunks, upper, parent } = file;
    const first = parts.length;
    firsts.push(first);
    parts.push({ file, first: 0, chunks: upper, parent: parent && partAt(pages, firsts, parent) });
    for (let at = upper, above = 0; at < chunks; at += SLOT_CHUNKS, above++) {
      parts.push({ file, first: at, chunks: Math.min(SLOT_CHUNKS, chunks - at), parent: [first, above] });
    }
  }
  return { parts, firsts };
}

/** Returns the index of the page that contains a chunk of a file, and the index of the chunk in that page. */
function partAt(
  files: readonly TreePage[],
  firsts: readonly number[],
  [file, chunk]: readonly [number, number],
): [part: number, chunk: number] {
  const lower = chunk - files[file].upper;
  if (lower < 0) return [firsts[file], chunk];
  return [firsts[file] + 1 + Math.floor(lower / SLOT_CHUNKS), lower % SLOT_CHUNKS];
}

/** Returns the pages of all instances of a manifest. */
export function listPages({ trees, instances }: DetailManifest): InstanceList {
  const cut = trees.map(partsOf);
  const count = instances.reduce((sum, { tree }) => sum + cut[tree].parts.length, 0);
  const list = emptyList(new Uint32Array(count).fill(1));
  const instanceOf = new Uint32Array(count);
  const firstOf = new Uint32Array(instances.length);
  let first = 0;
  instances.forEach(({ tree, parent: above }, i) => {
    const { parts } = cut[tree];
    firstOf[i] = first;
    parts.forEach(({ chunks, parent }, p) => {
      instanceOf[first + p] = i;
      list.chunks[first + p] = chunks;
      list.upper[first + p] = chunks;
      if (parent) putBelow(list, first + p, first + parent[0], parent[1], 1);
      // The parent is in the first instance, whose pages have the lowest indices.
      else if (above)
        putBelow(list, first + p, ...partAt(trees[instances[0].tree].pages, cut[instances[0].tree].firsts, above), 1);
    });
    first += parts.length;
  });
  return {
    ...list,
    place: (page) => cut[instances[instanceOf[page]].tree].parts[page - firstOf[instanceOf[page]]],
    translate: (page) => instances[instanceOf[page]].translate,
  };
}
