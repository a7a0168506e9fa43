import type { Vector3 } from '@gaussian-splat/core';
import { SLOT_CHUNKS, type DetailManifest, type Tree, type TreePage } from './manifest.js';
import { NONE } from '../ranked-heap.js';

export { NONE };

/** The pages of a streamed scene, parents before children. */
export interface PageList {
  readonly count: number;
  /** [P] number of slots of each page, one for each {@link SLOT_CHUNKS} chunks. */
  readonly slots: Uint32Array;
  /** [P] number of chunks of each page; a run has fewer if some of its splats are unusable. */
  readonly chunks: Uint32Array;
  /** [P] number of chunks that have their parent in another page or none. */
  readonly upper: Uint32Array;
  /** [P] page of the parent chunks, or {@link NONE}, the first of these chunks in it and their number. */
  readonly parent: Uint32Array;
  readonly parentChunk: Uint32Array;
  readonly parentChunks: Uint32Array;
  /** [P] index of a page's first chunk in {@link children}. */
  readonly firstChunk: Uint32Array;
  /** Page with the children of each chunk, or {@link NONE}; {@link SLOT_CHUNKS} for each slot. */
  readonly children: Uint32Array;
}

/** Location of a page of a folder: a file, the first chunk in it, and the number of chunks. */
export interface PagePlace {
  readonly file: TreePage;
  readonly first: number;
  readonly chunks: number;
}

/** The pages of all instances of a scene, numbered consecutively, first instance first. */
export interface InstanceList extends PageList {
  readonly place: (page: number) => PagePlace;
  readonly translate: (page: number) => Vector3;
}

/** A list of pages with these numbers of slots, without parents yet. */
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

/** Makes a page the child of some chunks of an earlier one. */
export function putBelow(list: PageList, page: number, parent: number, firstChunk: number, chunks: number): void {
  list.parent[page] = parent;
  list.parentChunk[page] = firstChunk;
  list.parentChunks[page] = chunks;
  const from = list.firstChunk[parent] + firstChunk;
  list.children.fill(page, from, from + chunks);
}

/** Indices of the child pages of the chunks in one slot of a page, {@link NONE} for none. */
export function childrenIn(list: PageList, page: number, slot: number): Uint32Array {
  const from = list.firstChunk[page] + SLOT_CHUNKS * slot;
  return list.children.subarray(from, from + Math.min(SLOT_CHUNKS, list.chunks[page] - SLOT_CHUNKS * slot));
}

/** [P] 1 for pages that need more slots, including all their ancestors, than this limit. */
export function largerThan(max: number, { count, slots, parent }: PageList): Uint8Array {
  const withAbove = new Float64Array(count);
  for (let page = 0; page < count; page++) {
    withAbove[page] = slots[page] + (parent[page] === NONE ? 0 : withAbove[parent[page]]);
  }
  return Uint8Array.from(withAbove, (needed) => (needed > max ? 1 : 0));
}

/** A page of a tree, and its parent page and chunk. */
interface TreePart extends PagePlace {
  readonly parent?: readonly [part: number, chunk: number];
}

/** The pages of a tree, and the index of the first page of each of its files. */
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

/** The page that holds a chunk of a file, and its index in that page. */
function partAt(
  files: readonly TreePage[],
  firsts: readonly number[],
  [file, chunk]: readonly [number, number],
): [part: number, chunk: number] {
  const lower = chunk - files[file].upper;
  if (lower < 0) return [firsts[file], chunk];
  return [firsts[file] + 1 + Math.floor(lower / SLOT_CHUNKS), lower % SLOT_CHUNKS];
}

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
      // The first instance has the lowest indices.
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
