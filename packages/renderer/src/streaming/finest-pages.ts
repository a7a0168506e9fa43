import { NONE, type InstanceList } from './page-list.js';

/**
 * The pages that show a scene best within so many chunks, those above others first: level by level from the roots down, until the next page has no room. A page takes the place of the
 * chunks that it is the detail of. The roots are always among them.
 */
export function finestPages(list: InstanceList, mostChunks: number): number[] {
  const { count, parent, parentChunks } = list;
  const depths = new Uint32Array(count);
  for (let page = 0; page < count; page++) if (parent[page] !== NONE) depths[page] = depths[parent[page]] + 1;
  const order = Array.from({ length: count }, (_, page) => page).sort((a, b) => depths[a] - depths[b] || a - b);
  const chosen = new Set<number>();
  let chunks = 0;
  for (const page of order) {
    const isRoot = parent[page] === NONE;
    if (!isRoot && !chosen.has(parent[page])) continue;
    const more = list.place(page).chunks - (isRoot ? 0 : parentChunks[page]);
    if (!isRoot && chunks + more > mostChunks) continue;
    chosen.add(page);
    chunks += more;
  }
  return [...chosen];
}
