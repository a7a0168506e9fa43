import { NONE, type InstanceList } from './page-list.js';

/**
 * Selects the pages that show a scene best within a number of chunks. Pages are added level by level from the roots, in
 * the order of the list, if their parent is selected and they fit. A page replaces the parent chunks. The roots are
 * always included.
 * @returns Indices of the selected pages, parents before children.
 */
export function finestPages(list: InstanceList, maxChunks: number): number[] {
  const { count, parent, parentChunks } = list;
  const depths = new Uint32Array(count);
  for (let page = 0; page < count; page++) if (parent[page] !== NONE) depths[page] = depths[parent[page]] + 1;
  // The depth is packed in front of the page index, because plain numbers sort much faster than objects.
  const order = Float64Array.from(depths, (depth, page) => depth * 2 ** 32 + page).sort();
  const chosen = new Set<number>();
  let chunks = 0;
  for (const key of order) {
    // Limits the number of pages, because even a page that adds no chunks costs time.
    if (chosen.size > 2 * maxChunks) break;
    const page = key % 2 ** 32;
    const isRoot = parent[page] === NONE;
    if (!isRoot && !chosen.has(parent[page])) continue;
    const more = list.place(page).chunks - (isRoot ? 0 : parentChunks[page]);
    if (!isRoot && chunks + more > maxChunks) continue;
    chosen.add(page);
    chunks += more;
  }
  return [...chosen];
}
