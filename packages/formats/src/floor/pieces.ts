import type { FloorWork } from './floor-work.js';
import { LEVEL, linksOf, type Cells } from './heights.js';

/** Minimum area in m² of a piece beyond a step that leads nowhere else. Smaller ones are furniture, or the bottom of a pit. */
const MIN_END = 2;

export interface ReachOptions {
  /** Index of the cell from which the body starts. */
  readonly start: number;
  /** Number of columns along x. */
  readonly nx: number;
  /** Maximum height of a step in meters. */
  readonly step: number;
  /** Area of a cell in m². */
  readonly area: number;
}

/**
 * Returns the indices of those cells that a body reaches from the cell `start` by steps of at most `step` meters, without
 * furniture. A piece of a floor is furniture if it is small and leads to no other piece: then the box, the chair and the table
 * of a row are not climbed, but the treads of stairs remain, because they lead to another floor.
 * @param isFree Whether a body fits in each cell.
 */
export function reachable(
  floor: Cells,
  { start, nx, step, area }: ReachOptions,
  isFree: readonly boolean[],
  work: FloorWork,
): number[] {
  const links = linksOf(floor, nx, step);
  const neighbors: number[][] = floor.cells.map(() => []);
  for (const next of links)
    next.forEach((to, from) => {
      if (to < 0) return;
      neighbors[from].push(to);
      neighbors[to].push(from);
    });
  const { heights } = floor;
  const fill = (first: number, limit: number, mark: (index: number) => boolean): number[] => {
    const found = [first];
    mark(first);
    for (let k = 0; k < found.length; k++) {
      work.take(4);
      for (const to of neighbors[found[k]])
        if (Math.abs(heights[to] - heights[found[k]]) <= limit && mark(to)) found.push(to);
    }
    return found;
  };
  const pieceOf = new Int32Array(floor.cells.length).fill(-1);
  const pieces: number[][] = [];
  const all = fillOnce(floor.cells.length, (mark) => fill(start, step, (index) => isFree[index] && mark(index)));
  for (const index of all)
    if (pieceOf[index] < 0)
      pieces.push(
        fill(index, LEVEL, (at) => {
          if (pieceOf[at] >= 0 || !isFree[at]) return false;
          pieceOf[at] = pieces.length;
          return true;
        }),
      );
  const beside = pieces.map(() => new Set<number>());
  for (const index of all)
    for (const to of neighbors[index])
      if (pieceOf[to] !== pieceOf[index] && pieceOf[to] >= 0) beside[pieceOf[index]].add(pieceOf[to]);
  const isEnd = (piece: number): boolean =>
    piece !== pieceOf[start] && beside[piece].size <= 1 && pieces[piece].length * area < MIN_END;
  const ends = pieces.map((_, piece) => piece).filter(isEnd);
  for (let piece = ends.pop(); piece !== undefined; piece = ends.pop()) {
    pieces[piece].forEach((index) => (pieceOf[index] = -1));
    for (const other of beside[piece]) {
      beside[other].delete(piece);
      if (isEnd(other)) ends.push(other);
    }
    pieces[piece] = [];
  }
  return all.filter((index) => pieceOf[index] >= 0);
}

/** Calls `fill` with a function that returns whether it marks an index for the first time. */
function fillOnce(count: number, fill: (mark: (index: number) => boolean) => number[]): number[] {
  const isMarked = new Uint8Array(count);
  return fill((index) => isMarked[index] === 0 && (isMarked[index] = 1) === 1);
}
