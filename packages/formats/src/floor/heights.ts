import type { ExtinctionGrid } from './extinction.js';
import type { FloorWork } from './floor-work.js';
import { widened } from './solids.js';

/** Connected cells of a floor: indices x + nx · z of columns, and the height in meters of each. */
export interface Cells {
  readonly cells: readonly number[];
  readonly heights: readonly number[];
}

/** Maximum difference in height in meters between neighboring cells of one piece of a floor: less than any step. */
export const LEVEL = 0.12;
/** Distance in meters above and below a height within which the surface is searched again. */
const SEARCH = 0.3;
/** Maximum optical depth of a voxel that counts. A captured opaque surface has 2 or more, a floater or a faint floor less. */
const MAX_DEPTH = 2;
/** Costs, in optical depths, of a difference of one voxel between neighboring cells, and of a larger one. */
const [SLOPE_COST, JUMP_COST] = [0.6, 6];
/** Radius in meters of the square that has the usual heights around a cell. */
const LEVELED = 1;
/** Cost, in optical depths, of a height that is `e` times as rare in that square as another, for a cell without a surface. */
const RARE_COST = 5;
/** Minimum fraction of the optical depth of that square at a height. */
const RAREST = 1e-3;
/** Radius in meters of the square over which heights of one surface are averaged. */
const AVERAGED = 0.5;
/** Number of cells for which the search over neighbors is done at a time; it bounds its memory, 52 MB. */
const MAX_LABELS = 2 ** 23;

/**
 * Returns the heights of a floor that explain the most optical depth with the fewest jumps between cells. Faint floors of
 * trained scenes are spread over 20 cm, so no column alone has the height of the floor. The minimum is found as in
 * semi-global matching (Hirschmüller 2008): along the four directions of the grid, exactly along each.
 */
export function refinedHeights(grid: ExtinctionGrid, { cells, heights }: Cells, work: FloorWork): number[] {
  const { vertical, size, corner, voxel } = grid;
  const [nx, ny] = size;
  const reach = Math.max(1, Math.round(SEARCH / voxel));
  const labels = 2 * reach + 1;
  if (cells.length * labels > MAX_LABELS) return heights.slice();
  const bases = Int32Array.from(heights, (height) => Math.round((height - corner[1]) / voxel - 0.5) - reach);
  const columnOf = (index: number): number => (cells[index] % nx) + nx * ny * Math.floor(cells[index] / nx);
  const depthAt = (column: number, y: number): number => (y < 0 || y >= ny ? 0 : vertical[column + nx * y]);
  const level = widened(grid, Math.round(LEVELED / voxel), work);
  const levelAt = (column: number, y: number): number => (y < 0 || y >= ny ? 0 : Math.max(0, level[column + nx * y]));
  const costs = new Float32Array(cells.length * labels);
  work.take(costs.length);
  for (let index = 0; index < cells.length; index++) {
    const column = columnOf(index);
    // A surface hides those below it, such as the floor under stairs.
    let passed = 1;
    let [peak, sum] = [0, 1e-6];
    for (let y = bases[index] + labels - 1, at = (index + 1) * labels - 1; y >= bases[index]; y--, at--) {
      if (y < bases[index] + labels - 2) passed *= Math.exp(-depthAt(column, y + 2));
      const depth = depthAt(column, y) + 0.5 * (depthAt(column, y - 1) + depthAt(column, y + 1));
      costs[at] = MAX_DEPTH - passed * Math.min(MAX_DEPTH, depth);
      peak = Math.max(peak, Math.min(MAX_DEPTH, depth));
      sum += levelAt(column, y);
    }
    // Single columns of a faint trained floor are off by 10 cm, but together they have a usual height.
    const weight = RARE_COST * (1 - peak / MAX_DEPTH) ** 3;
    for (let label = 0, at = index * labels; label < labels; label++, at++)
      costs[at] -= weight * Math.log(levelAt(column, bases[index] + label) / sum + RAREST);
  }
  const totals = new Float32Array(costs.length);
  const links = linksOf({ cells, heights }, nx, SEARCH);
  for (const next of links) {
    const before = inverseOf(next);
    addPaths({ costs, totals, bases, labels }, next, before, work);
    addPaths({ costs, totals, bases, labels }, before, next, work);
  }
  const peaks = Int32Array.from(cells, (_, index) => {
    let best = 0;
    const first = index * labels;
    for (let label = 1; label < labels; label++) if (totals[first + label] < totals[first + best]) best = label;
    return bases[index] + best;
  });
  return averaged(peaks, heights, { columnOf, depthAt, links, grid }, work);
}

interface Labels {
  readonly costs: Float32Array;
  readonly totals: Float32Array;
  /** Index along y of the first label of each cell. */
  readonly bases: Int32Array;
  readonly labels: number;
}

/** Returns, for links to the next cells, those to the previous ones; -1 for cells that none is linked to. */
function inverseOf(next: Int32Array): Int32Array {
  const before = new Int32Array(next.length).fill(-1);
  next.forEach((to, from) => to >= 0 && (before[to] = from));
  return before;
}

/** Adds the minimum costs of all paths that end in a cell and follow `next`. */
function addPaths(
  { costs, totals, bases, labels }: Labels,
  next: Int32Array,
  before: Int32Array,
  work: FloorWork,
): void {
  let path = new Float32Array(labels);
  let own = new Float32Array(labels);
  for (let start = 0; start < next.length; start++) {
    if (before[start] >= 0) continue;
    path.fill(0);
    for (let index = start, last = start; index >= 0; last = index, index = next[index]) {
      work.take(labels);
      const shift = bases[index] - bases[last];
      const jump = path.reduce((a, b) => Math.min(a, b)) + JUMP_COST;
      const min = jump - JUMP_COST;
      for (let label = 0; label < labels; label++) {
        const from = label + shift;
        const level = path[from] ?? Infinity;
        const slope = Math.min(path[from - 1] ?? Infinity, path[from + 1] ?? Infinity) + SLOPE_COST;
        const at = index * labels + label;
        own[label] = costs[at] + (index === start ? 0 : Math.min(level, slope, jump) - min);
        totals[at] += own[label];
      }
      [path, own] = [own, path];
    }
  }
}

/** Returns, for the directions +x and +z, the index of each cell's neighbor; -1 if it has none within `step` meters. */
export function linksOf({ cells, heights }: Cells, nx: number, step: number): readonly [Int32Array, Int32Array] {
  const columns = new Map<number, number[]>();
  cells.forEach((cell, index) => {
    const own = columns.get(cell);
    if (own) own.push(index);
    else columns.set(cell, [index]);
  });
  const along = (offset: number): Int32Array => {
    const isTaken = new Uint8Array(cells.length);
    return Int32Array.from(cells, (cell, index) => {
      if (offset === 1 && cell % nx === nx - 1) return -1;
      const to = columns
        .get(cell + offset)
        ?.find((other) => isTaken[other] === 0 && Math.abs(heights[other] - heights[index]) <= step);
      if (to === undefined) return -1;
      isTaken[to] = 1;
      return to;
    });
  };
  return [along(1), along(nx)];
}

interface Surface {
  readonly columnOf: (index: number) => number;
  readonly depthAt: (column: number, y: number) => number;
  readonly links: readonly [Int32Array, Int32Array];
  readonly grid: ExtinctionGrid;
}

/** Returns the mean height of the optical depth around the peaks of cells, over the neighbors with the same surface. */
function averaged(
  peaks: Int32Array,
  heights: readonly number[],
  { columnOf, depthAt, links, grid }: Surface,
  work: FloorWork,
): number[] {
  const { corner, voxel } = grid;
  const count = peaks.length;
  // Sums of optical depth, and of optical depth times its distance from the peak, in voxels.
  const depths = new Float64Array(count);
  const moments = new Float64Array(count);
  for (let index = 0; index < count; index++)
    for (let k = -1; k <= 1; k++) {
      const depth = depthAt(columnOf(index), peaks[index] + k);
      depths[index] += depth;
      moments[index] += k * depth;
    }
  const radius = Math.max(1, Math.round(AVERAGED / voxel));
  for (const next of links) {
    const before = inverseOf(next);
    const [oldDepths, oldMoments] = [depths.slice(), moments.slice()];
    for (let index = 0; index < count; index++)
      for (const way of [next, before])
        for (let k = 0, at = way[index]; k < radius && at >= 0; k++, at = way[at]) {
          work.take(1);
          // Another surface ends the average.
          const off = peaks[at] - peaks[index];
          if (Math.abs(off) > 1) break;
          depths[index] += oldDepths[at];
          moments[index] += oldMoments[at] + off * oldDepths[at];
        }
  }
  return heights.map((height, index) =>
    depths[index] > 1e-3 ? corner[1] + voxel * (peaks[index] + 0.5 + moments[index] / depths[index]) : height,
  );
}
