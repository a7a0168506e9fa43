import { columnOf, heightOf, placeAt, rowOf, type FloorMap } from './floor-map.js';

/** Position (x, height of the floor, z) in meters. */
type Place = readonly [x: number, y: number, z: number];

/** Number of heights that are compared in one task, some milliseconds. */
const HEIGHTS_PER_TASK = 2 ** 19;
/** Maximum numbers of heights that are compared, about a second, and of places that are visited. */
const MAX_HEIGHTS = 2 ** 28;
const MAX_VISITED = 2 ** 22;
/** Maximum number of cells of a path. */
const MAX_PATH = 2 ** 16;

const NEIGHBORS = [
  [1, 0],
  [-1, 0],
  [0, 1],
  [0, -1],
  [1, 1],
  [1, -1],
  [-1, 1],
  [-1, -1],
] as const;

/**
 * Finds the path over the floor with the fewest cells between two positions, by breadth-first search over cells with
 * eight neighbors. The search is divided into tasks of some milliseconds, and ends after a bounded number of cells.
 * @returns Positions from cell to cell without `from`; the last is `to`. Empty if there is no path, or a longer one than
 * the search may find.
 * @throws The reason of `signal`
 */
export async function wayTo(map: FloorMap, from: Place, to: Place, signal?: AbortSignal): Promise<readonly Place[]> {
  const start = placeAt(map, columnOf(map, from[0]), rowOf(map, from[2]), from[1]);
  const goal = placeAt(map, columnOf(map, to[0]), rowOf(map, to[2]), to[1]);
  if (start < 0 || goal < 0) return [];
  const search = new Search(map, start);
  for (let compared = 0; compared < MAX_HEIGHTS; compared += HEIGHTS_PER_TASK) {
    const found = search.advance(goal, HEIGHTS_PER_TASK);
    if (found !== undefined) return found ? search.wayTo(goal, to) : [];
    await new Promise((resolve) => setTimeout(resolve));
    signal?.throwIfAborted();
  }
  return [];
}

/** A breadth-first search, which can be continued. */
class Search {
  readonly #map: FloorMap;
  readonly #size: number;
  /** For each visited place, the place before it plus 1; 0 for others. Typed, because a floor may have millions of cells. */
  readonly #before: Int32Array;
  readonly #queue: Int32Array;
  #head = 0;
  #tail = 1;

  constructor(map: FloorMap, start: number) {
    this.#map = map;
    this.#size = map.width * map.depth;
    this.#before = new Int32Array(map.layers.length * this.#size);
    this.#queue = new Int32Array(Math.min(MAX_VISITED, this.#before.length));
    [this.#before[start], this.#queue[0]] = [start + 1, start];
  }

  /** Continues until `heights` have been compared. Returns whether the goal is reached; undefined if that is open. */
  advance(goal: number, heights: number): boolean | undefined {
    // A place compares the heights of eight cells, and of two more for each diagonal.
    const perPlace = 16 * this.#map.layers.length;
    for (let left = heights; left > 0 && this.#head < this.#tail; left -= perPlace) {
      const place = this.#queue[this.#head++];
      if (place === goal) return true;
      this.#visit(place);
    }
    return this.#head < this.#tail ? undefined : false;
  }

  #visit(place: number): void {
    const map = this.#map;
    const height = heightOf(map, place);
    const [column, row] = this.#cellOf(place);
    for (const [i, j] of NEIGHBORS) {
      const next = placeAt(map, column + i, row + j, height);
      if (next < 0 || this.#before[next] > 0 || this.#tail === this.#queue.length) continue;
      // A diagonal step requires a floor in both cells beside it, because a body does not cut corners.
      const isCorner = i !== 0 && j !== 0;
      if (isCorner && (placeAt(map, column + i, row, height) < 0 || placeAt(map, column, row + j, height) < 0))
        continue;
      this.#before[next] = place + 1;
      this.#queue[this.#tail++] = next;
    }
  }

  #cellOf(place: number): readonly [column: number, row: number] {
    const cell = place % this.#size;
    return [cell % this.#map.width, Math.floor(cell / this.#map.width)];
  }

  /** Returns the positions on the way to a visited place, without the first; the last is `to`. */
  wayTo(goal: number, to: Place): readonly Place[] {
    const { cell, corner } = this.#map;
    const way = [to];
    for (let place = this.#before[goal] - 1; place + 1 !== this.#before[place]; place = this.#before[place] - 1) {
      if (way.length > MAX_PATH) return [];
      const [column, row] = this.#cellOf(place);
      way.push([corner[0] + (column + 0.5) * cell, heightOf(this.#map, place), corner[1] + (row + 0.5) * cell]);
    }
    return way.reverse();
  }
}
