import { NONE, type InstanceList } from './page-list.js';

/**
 * The pages that show a scene best within a number of chunks, those above others first: level by level from the roots down, until the next page has no room. A page takes the place of the
 * chunks that it is the detail of. The roots are always among them.
 */
export function finestPages(list: InstanceList, mostChunks: number): number[] {
  const { count, parent, parentChunks } = list;
  const depths = new Uint32Array(count);
  for (let page = 0; page < count; page++) if (parent[page] !== NONE) depths[page] = depths[parent[page]] + 1;
  // Numbers with the depth in front of them, for the sort of numbers is much the fastest.
  const order = Float64Array.from(depths, (depth, page) => depth * 2 ** 32 + page).sort();
  const chosen = new Set<number>();
  let chunks = 0;
  for (const key of order) {
    // A page that adds nothing costs time all the same.
    if (chosen.size > 2 * mostChunks) break;
    const page = key % 2 ** 32;
    const isRoot = parent[page] === NONE;
    if (!isRoot && !chosen.has(parent[page])) continue;
    const more = list.place(page).chunks - (isRoot ? 0 : parentChunks[page]);
    if (!isRoot && chunks + more > mostChunks) continue;
    chosen.add(page);
    chunks += more;
  }
  return [...chosen];
}
