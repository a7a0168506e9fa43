import type { GaussianCloud, Vector3 } from '@gaussian-splat/core';
import { grouped } from '../bytes.js';
import { extinctionOf, type ExtinctionGrid, type GridOptions, type VoxelGrid } from './extinction.js';
import { FloorWork, tooLarge } from './floor-work.js';
import { LEVEL, refinedHeights } from './heights.js';
import { reachable } from './pieces.js';
import { solidsOf, widened } from './solids.js';
import type { FloorMap } from './floor-map.js';

export interface FloorOptions extends GridOptions {
  /** Free height in meters that a body needs above the floor; default 1.6. */
  readonly height?: number;
  /** Radius of a body in meters; default 0.2. */
  readonly radius?: number;
  /** Maximum height of a step up or down in meters; default 0.3. */
  readonly step?: number;
  /** Point above the start of the walk, in meters with y up. Default: infinitely high above the center of the scene. */
  readonly near?: Vector3;
}

/** Distance in meters from a gap in the floor to the floor on two opposite sides, so that the gap is bridged. */
const BRIDGE = 0.3;
/** Depths in meters below a floor at which a solid surface makes a gap a pit, which is not bridged. */
const [PIT_TOP, PIT_BOTTOM] = [0.5, 3];
/** Minimum vertical optical depth of a faint floor: mean over the square around a body, within three voxels. */
const FAINT_DEPTH = 0.2;
/** Maximum number of cells along the radius of a body. With smaller voxels, only some cells under it are examined. */
const MAX_RADIUS = 8;
/** Optical depth below which a column has no surface of its own. */
const EMPTY_DEPTH = 0.05;
/** Minimum fraction of the optical depth within a step above and below a faint floor that is within its three voxels. */
const FAINT_SHARE = 0.4;
/** Horizontal distances in meters of the floor from the point `near`: the first with a large floor is used. */
const REACHES = [0.3, 1, 3] as const;
/** Minimum area in m² of a floor that is preferred to farther ones. */
const LARGE = 4;
/** Maximum number of columns of a grid, of their floors, and of the cells of all regions: 10,000 m² at 5 cm. */
const MAX_FLOORS = 2 ** 22;
/** Maximum number of heights of a map over all layers, 128 MB of float32. */
const MAX_HEIGHTS = 2 ** 25;

/**
 * Finds the walkable floor of a scene from its splats. Surfaces are solid voxels with free height above, which a flood
 * fill joins if a body fits between them. The result is the floor below `near`: the largest within 0.3 m of it, or else
 * within 1 or 3 m, or else the lowest of the large floors.
 * @throws GaussianSplatError `argument/value` for lengths that are not positive and finite; `out-of-memory/budget` for
 * a scene that takes too much work or memory.
 */
export function makeFloorMap(cloud: GaussianCloud, options: FloorOptions): FloorMap {
  const work = new FloorWork(options.limits);
  const grid = extinctionOf(cloud, options, work);
  return floorOf(grid, solidsOf(grid), options, work);
}

/** A grid with or without the optical depth of its voxels. */
type FloorGrid = VoxelGrid & Partial<ExtinctionGrid>;
const isExtinction = (grid: FloorGrid): grid is ExtinctionGrid => grid.vertical !== undefined;

/**
 * Finds the walkable floor as {@link makeFloorMap} does, but from solid voxels. If `grid` has no optical depths, a surface
 * is at the center of its voxel.
 * @param solid Voxels, [nz, ny, nx]: 1 for solid, 0 for empty.
 * @throws GaussianSplatError `out-of-memory/budget` as {@link makeFloorMap} does.
 */
export function floorOf(
  grid: FloorGrid,
  solid: Uint8Array,
  options: Omit<FloorOptions, 'frame'> = {},
  work = new FloorWork(options.limits),
): FloorMap {
  const body: Body = { height: 1.6, radius: 0.2, step: 0.3, ...options };
  const { corner, size, voxel } = grid;
  const middle = [0, 2].map((axis) => corner[axis] + (size[axis] * voxel) / 2);
  const near: Vector3 = options.near ?? [middle[0], Infinity, middle[1]];
  return new FloorFinder(grid, solid, body, work).find(near);
}

interface Body {
  readonly height: number;
  readonly radius: number;
  readonly step: number;
}

/** Heights in meters of all surfaces of a column with free height above, from the top down. */
interface Floors {
  readonly solid: readonly number[];
  /** Surfaces that only together with those of other columns are opaque. */
  readonly faint: readonly number[];
}

/** Returns the nearest height to `y`; undefined if all are farther than `reach`. */
function nearestOf(heights: readonly number[], y: number, reach: number): number | undefined {
  let best: number | undefined;
  for (const height of heights)
    if (Math.abs(height - y) <= Math.min(reach, Math.abs((best ?? Infinity) - y))) best = height;
  return best;
}

/** A connected floor: cells, as indices x + nx · z, and the height in meters of each. */
interface Region {
  readonly cells: readonly number[];
  readonly heights: readonly number[];
  /** Index in `cells` of the cell nearest to the point `near`. */
  readonly nearest: number;
  /** Horizontal distance in meters of the nearest cell from the point `near`; infinite if all cells are above it. */
  readonly distance: number;
  /** Minimum height in meters. */
  readonly bottom: number;
}

const NOWHERE: Region = { cells: [], heights: [], nearest: 0, distance: 0, bottom: 0 };
/** Minimum area of a large floor, relative to the largest floor. */
const COMPARABLE = 0.5;

const largestOf = (regions: readonly Region[]): Region | undefined =>
  regions.reduce<Region | undefined>(
    (best, region) => (best && best.cells.length >= region.cells.length ? best : region),
    undefined,
  );

/** Returns the lowest of the large floors, because a roof may be as large as the floor under it. */
function lowestOf(regions: readonly Region[]): Region {
  const max = largestOf(regions)?.cells.length ?? 0;
  const large = regions.filter(({ cells }) => cells.length >= COMPARABLE * max);
  return large.reduce((best, region) => (region.bottom < best.bottom ? region : best), large[0] ?? NOWHERE);
}

class FloorFinder {
  readonly #grid: FloorGrid;
  readonly #solid: Uint8Array;
  readonly #body: Body;
  readonly #floors: readonly Floors[];
  /** For each column, heights in meters that already belong to a region. */
  readonly #seen: number[][];
  readonly #disc: readonly (readonly [x: number, z: number])[];
  readonly #work: FloorWork;
  /** Vertical optical depths, mean over the square around a body. */
  readonly #wide: Float32Array | undefined;
  /** Number of cells of all regions. */
  #cells = 0;

  constructor(grid: FloorGrid, solid: Uint8Array, body: Body, work: FloorWork) {
    this.#grid = grid;
    this.#solid = solid;
    this.#body = body;
    this.#work = work;
    const [nx, , nz] = grid.size;
    if (isExtinction(grid)) this.#wide = widened(grid, Math.ceil(body.radius / grid.voxel), work);
    requireAtMost(nx * nz, MAX_FLOORS, 'columns');
    let count = 0;
    this.#floors = Array.from({ length: nx * nz }, (_, c) => {
      const floors = this.#floorsOf(c % nx, Math.floor(c / nx));
      requireAtMost(
        (count += floors.solid.length + floors.faint.length),
        MAX_FLOORS,
        'surfaces with free height above',
      );
      return floors;
    });
    this.#seen = this.#floors.map(() => []);
    this.#disc = discOf(body.radius / grid.voxel);
  }

  find(near: Vector3): FloorMap {
    const [nx] = this.#grid.size;
    const regions: Region[] = [];
    this.#floors.forEach(({ solid, faint }, c) => {
      for (const height of [...solid, ...faint]) {
        if (this.#isSeen(c, height) || this.#isBlocked(c % nx, Math.floor(c / nx), height)) continue;
        regions.push(this.#fill(c, height, near));
      }
    });
    const isLarge = ({ cells }: Region): boolean => cells.length * this.#grid.voxel ** 2 >= LARGE;
    // The floor under the point, even if a larger one is behind a wall. A point at infinity is above the roof, too.
    const [reach] = REACHES.slice(-1);
    const reached =
      (near[1] === Infinity ? [] : REACHES)
        .map((each) => regions.filter((region) => region.distance <= each && isLarge(region)))
        .find((found) => found.length > 0) ?? regions.filter(({ distance }) => distance <= reach);
    const region = largestOf(reached) ?? lowestOf(regions);
    if (region.cells.length === 0) return this.#mapOf(region);
    const { cells, nearest } = region;
    const heights = isExtinction(this.#grid) ? refinedHeights(this.#grid, region, this.#work) : region.heights;
    const from = { start: nearest, nx, step: this.#body.step, area: this.#grid.voxel ** 2 };
    const isFree = cells.map((c, k) => k === nearest || !this.#isBlocked(c % nx, Math.floor(c / nx), heights[k]));
    const kept = reachable({ cells, heights }, from, isFree, this.#work);
    return this.#mapOf({
      cells: kept.map((index) => cells[index]),
      heights: kept.map((index) => heights[index]),
      nearest: kept.indexOf(nearest),
    });
  }

  /**
   * Returns the heights in meters of the floors of a column, from the top down: solid surfaces, and between them the most
   * opaque places under a whole body, because a floor may be faint. A surface is at the peak of the optical depth, which a parabola
   * through three voxels interpolates.
   */
  #floorsOf(x: number, z: number): Floors {
    const { size, corner, voxel } = this.#grid;
    const [nx, ny] = size;
    const needed = Math.ceil(this.#body.height / voxel);
    const reach = Math.ceil(this.#body.step / voxel);
    const column = x + nx * ny * z;
    const { vertical } = this.#grid;
    const wide = this.#wide;
    const depthAt = (depths: Float32Array | undefined, y: number): number =>
      depths === undefined || y < 0 || y >= ny ? 0 : depths[column + nx * y];
    const sumAt = (depths: Float32Array | undefined, y: number): number =>
      depthAt(depths, y - 1) + depthAt(depths, y) + depthAt(depths, y + 1);
    const heightOf = (depths: Float32Array | undefined, peak: number): number => {
      const [under, here, over] = [-1, 0, 1].map((k) => depthAt(depths, peak + k));
      const bend = under - 2 * here + over;
      const shift = bend < 0 ? Math.min(0.5, Math.max(-0.5, (under - over) / (2 * bend))) : 0;
      return corner[1] + voxel * (peak + 0.5 + shift);
    };
    const isFaint = (y: number): boolean => {
      const sum = sumAt(wide, y);
      if (sum < FAINT_DEPTH) return false;
      this.#work.take(2 * reach);
      let around = depthAt(wide, y);
      for (let k = 1; k <= reach; k++) {
        if (sumAt(wide, y + k) > sum || sumAt(wide, y - k) >= sum) return false;
        around += depthAt(wide, y - k) + depthAt(wide, y + k);
      }
      // Haze and floaters are everywhere; a floor is at one height.
      if (sum < FAINT_SHARE * around) return false;
      // Beyond the edge of a hole, the square around a body still has some of the floor.
      return sumAt(vertical, y) >= EMPTY_DEPTH || !this.#isPit(x, z, corner[1] + voxel * (y + 0.5));
    };
    this.#work.take(ny);
    const [solid, faint]: [number[], number[]] = [[], []];
    for (let y = ny - 2, free = needed; y >= 0; y--) {
      if (this.#solid[column + nx * y] === 0) {
        if (free >= needed && wide !== undefined && isFaint(y)) faint.push(heightOf(wide, y));
        free++;
        continue;
      }
      if (free >= needed) {
        let peak = y;
        for (let below = y - 1; below >= Math.max(1, y - 2); below--)
          if (depthAt(vertical, below) > depthAt(vertical, peak)) peak = below;
        solid.push(heightOf(vertical, peak));
      }
      free = 0;
    }
    return { solid, faint };
  }

  /** Returns the floor of a column that is nearest to a height: a solid one within a step, or a faint one at its level. */
  #near(c: number, y: number): number | undefined {
    this.#work.take(1 + this.#floors[c].solid.length + this.#floors[c].faint.length);
    const { solid, faint } = this.#floors[c];
    return nearestOf(solid, y, this.#body.step) ?? nearestOf(faint, y, LEVEL);
  }

  #isSeen(c: number, height: number): boolean {
    this.#work.take(1 + this.#seen[c].length);
    return this.#seen[c].some((seen) => Math.abs(seen - height) <= this.#body.step / 2);
  }

  /** Returns the mean height of floors on two opposite sides of a gap; undefined if there are none. */
  #bridged(x: number, z: number, y: number): number | undefined {
    if (this.#isPit(x, z, y)) return undefined;
    const gap = Math.ceil(BRIDGE / this.#grid.voxel);
    for (const [dx, dz] of DIRECTIONS) {
      const before = this.#firstFloor(x, z, -dx, -dz, y, gap);
      const after = before === undefined ? undefined : this.#firstFloor(x, z, dx, dz, y, gap);
      if (before !== undefined && after !== undefined && Math.abs(before - after) <= LEVEL) return (before + after) / 2;
    }
    return undefined;
  }

  #isPit(x: number, z: number, y: number): boolean {
    const { size, corner, voxel } = this.#grid;
    const [nx, ny] = size;
    const levelOf = (height: number): number => Math.max(0, Math.round((height - corner[1]) / voxel - 0.5));
    const [low, high] = [levelOf(y - PIT_BOTTOM), Math.min(ny, levelOf(y - PIT_TOP))];
    this.#work.take(Math.max(1, high - low));
    for (let k = low; k < high; k++) if (this.#solid[x + nx * (k + ny * z)] === 1) return true;
    return false;
  }

  #firstFloor(x: number, z: number, dx: number, dz: number, y: number, gap: number): number | undefined {
    const [nx, , nz] = this.#grid.size;
    for (let k = 1; k <= gap; k++) {
      const [i, j] = [x + k * dx, z + k * dz];
      if (i < 0 || j < 0 || i >= nx || j >= nz) return undefined;
      const height = this.#near(i + nx * j, y);
      if (height !== undefined) return height;
    }
    return undefined;
  }

  /** Whether a solid voxel obstructs a body at height `y`, between the height of a step and that of the body. */
  #isBlocked(x: number, z: number, y: number): boolean {
    const { size, corner, voxel } = this.#grid;
    const [nx, ny, nz] = size;
    const low = Math.max(0, Math.ceil((y + this.#body.step - corner[1]) / voxel));
    const high = Math.min(ny - 1, Math.floor((y + this.#body.height - corner[1]) / voxel));
    for (const [dx, dz] of this.#disc) {
      const [i, j] = [x + dx, z + dz];
      if (i < 0 || j < 0 || i >= nx || j >= nz) continue;
      this.#work.take(Math.max(1, high + 1 - low));
      for (let k = low; k <= high; k++) if (this.#solid[i + nx * (k + ny * j)] === 1) return true;
    }
    return false;
  }

  /** Returns the region of all cells that a body can reach from a height of a column, by a flood fill. */
  #fill(start: number, height: number, near: Vector3): Region {
    const { size, corner, voxel } = this.#grid;
    const [nx, , nz] = size;
    const [nearX, nearZ] = [(near[0] - corner[0]) / voxel, (near[2] - corner[2]) / voxel];
    const cells = [start];
    const heights = [height];
    this.#seen[start].push(height);
    let [nearest, shortest, bottom] = [0, Infinity, height];
    for (const open = [0]; open.length > 0;) {
      const index = open.pop()!;
      const [c, y] = [cells[index], heights[index]];
      const [x, z] = [c % nx, Math.floor(c / nx)];
      bottom = Math.min(bottom, y);
      const distance = Math.hypot(x + 0.5 - nearX, z + 0.5 - nearZ);
      // The floor under the point, not the ceiling above it.
      const isHigher = distance === shortest && y > heights[nearest];
      if (y <= near[1] && (distance < shortest || isHigher)) [shortest, nearest] = [distance, index];
      for (const [dx, dz] of SIDES) {
        const [i, j] = [x + dx, z + dz];
        if (i < 0 || j < 0 || i >= nx || j >= nz) continue;
        const next = i + nx * j;
        const reached = this.#near(next, y) ?? this.#bridged(i, j, y);
        if (reached === undefined || this.#isSeen(next, reached) || this.#isBlocked(i, j, reached)) continue;
        this.#seen[next].push(reached);
        requireAtMost(++this.#cells, MAX_FLOORS, 'cells');
        open.push(cells.length);
        cells.push(next);
        heights.push(reached);
      }
    }
    return { cells, heights, nearest, distance: shortest * voxel, bottom };
  }

  /** Converts a region to a map, cropped to the rectangle of its cells. */
  #mapOf({ cells, heights, nearest }: Pick<Region, 'cells' | 'heights' | 'nearest'>): FloorMap {
    const { size, corner, voxel } = this.#grid;
    const [nx] = size;
    let [x0, x1, z0, z1] = [Infinity, -1, Infinity, -1];
    for (const c of cells) {
      const [x, z] = [c % nx, Math.floor(c / nx)];
      [x0, x1, z0, z1] = [Math.min(x0, x), Math.max(x1, x), Math.min(z0, z), Math.max(z1, z)];
    }
    const isEmpty = cells.length === 0;
    const [width, depth] = isEmpty ? [0, 0] : [x1 - x0 + 1, z1 - z0 + 1];
    const origin: readonly [number, number] = isEmpty
      ? [corner[0], corner[2]]
      : [corner[0] + x0 * voxel, corner[2] + z0 * voxel];
    const layers: Float32Array[] = [];
    cells.forEach((c, index) => {
      const at = (c % nx) - x0 + width * (Math.floor(c / nx) - z0);
      let layer = 0;
      while (layers[layer] !== undefined && !Number.isNaN(layers[layer][at])) layer++;
      this.#work.take(1 + layer);
      if (layer === layers.length) {
        requireAtMost(width * depth * (layer + 1), MAX_HEIGHTS, 'heights');
        layers.push(new Float32Array(width * depth).fill(NaN));
      }
      layers[layer][at] = heights[index];
    });
    const area = cells.length * voxel * voxel;
    const c = cells[nearest] ?? 0;
    const start: Vector3 = isEmpty
      ? [corner[0], corner[1], corner[2]]
      : [corner[0] + ((c % nx) + 0.5) * voxel, heights[nearest], corner[2] + (Math.floor(c / nx) + 0.5) * voxel];
    return { cell: voxel, corner: origin, width, depth, layers, step: this.#body.step, start, area };
  }
}

function requireAtMost(value: number, max: number, what: string): void {
  if (value > max) throw tooLarge(`at most ${grouped(max)} ${what}`, `${grouped(value)} or more`);
}

const SIDES = [
  [1, 0],
  [-1, 0],
  [0, 1],
  [0, -1],
] as const;
const DIRECTIONS = [
  [1, 0],
  [0, 1],
  [1, 1],
  [1, -1],
] as const;

/**
 * Returns the cells under a body, relative to its center. The voxels of a surface reach half a voxel beyond it.
 * @param radius Radius in cells.
 */
function discOf(radius: number): (readonly [number, number])[] {
  const step = Math.max(1, Math.ceil(radius / MAX_RADIUS));
  const count = Math.floor(radius / step);
  const side = Array.from({ length: 2 * count + 1 }, (_, i) => step * (i - count));
  const max = Math.max(0, radius - 0.5) ** 2;
  return side.flatMap((z) => side.flatMap((x): [number, number][] => (x * x + z * z <= max ? [[x, z]] : [])));
}
