/** Pages without files, like those of a scene of any size, for tests of loading and eviction. */
import { emptyList, NONE, SLOT_CHUNKS, putBelow, type PageList } from '@gaussian-splat/renderer/stages';

/** A full tree: the number of pages with one slot each, and the number of children of each. */
export function pageTree(count: number, below = 16): PageList {
  const list = emptyList(new Uint32Array(count).fill(1));
  for (let page = 1; page < count; page++) list.parent[page] = Math.floor((page - 1) / below);
  return list;
}

/**
 * Page requests as a view records them: only for pages whose parent is resident, and each page less than its parent.
 * @param share returns the page's fraction, 0 to 1, of its parent's need
 */
export function requestsOf(
  list: PageList,
  isResident: (page: number) => boolean,
  share: (page: number) => number,
): Float32Array {
  const needs = new Float32Array(list.count).fill(1000);
  return needs.map((_, page) => {
    const above = list.parent[page];
    if (above === NONE) return needs[page];
    needs[page] = needs[above] * share(page);
    return isResident(above) ? needs[page] : 0;
  });
}

/**
 * Boxes with runs at several levels, as pages: all coarsest runs in the first, each finer one below that of its box.
 * @param boxes of each box the chunks of its runs, the coarsest first
 */
export function boxList(boxes: readonly (readonly number[])[]): PageList {
  const coarsest = boxes.reduce((sum, [chunks]) => sum + chunks, 0);
  const chunks = [coarsest, ...boxes.flatMap((runs) => runs.slice(1))];
  const list = emptyList(Uint32Array.from(chunks, (count) => Math.ceil(count / SLOT_CHUNKS)));
  list.chunks.set(chunks);
  list.upper.set(chunks);
  let [page, first] = [1, 0];
  for (const runs of boxes) {
    runs.slice(1).forEach((_, k) => {
      if (k === 0) putBelow(list, page, 0, first, runs[0]);
      else putBelow(list, page, page - 1, 0, runs[k]);
      page++;
    });
    first += runs[0];
  }
  return list;
}
