/** Places on which a body can stand in a scene of the studio, by its mesh. tests/fixtures/studio/README.md describes it. */
import { readFileSync } from 'node:fs';
import { fileURLToPath } from 'node:url';
import { gunzipSync } from 'node:zlib';
import type { FloorMap } from '@gaussian-splat/formats/floor';
import type { StudioScene } from './studio.js';

/** Edge of a cell of the reference, meters. */
const CELL = 0.025;
/** Meters around the rectangles of the floor that the reference covers. */
const MARGIN = 6;
/** Dimensions of the body of `FloorOptions`, meters. */
const [HEIGHT, RADIUS, STEP] = [1.6, 0.2, 0.3];
/** Height in meters by which a step may be too high, because the stones of the hall are exactly as high as a step. */
const ROUNDING = 0.005;
/** Distance in meters from a wall at which the middle of a body is in it. */
const IN_WALL = RADIUS / 2;

type Point = readonly [x: number, y: number, z: number];
type Rectangle = readonly [number, number, number, number];
const isIn = ([a, b, c, d]: Rectangle, x: number, z: number): boolean => x > a && x < b && z > c && z < d;

/** Square meters of a map, and errors of its heights in meters, sorted. */
export interface FloorFound {
  /** Places that the body reaches on the free floor, and those that the map has. */
  readonly free: number;
  readonly found: number;
  /** Places in walls or in the air; on furniture. */
  readonly outside: number;
  readonly taken: number;
  /** Ground that is walkable in the geometry, but is not in the rectangles of the floor. */
  readonly beyond: number;
  readonly errors: readonly number[];
}

/** The reference of a scene: y up. Heights are those of the highest surface that is at most a step above the floor. */
export class StudioFloor {
  readonly #floors: readonly Rectangle[];
  readonly #taken: readonly Rectangle[];
  readonly #corner: readonly [x: number, z: number];
  readonly #size: readonly [nx: number, nz: number];
  readonly #heights: Float32Array;
  /** Distances in meters from what obstructs a body; {@link RADIUS} at most. */
  readonly #clearance: Float32Array;

  constructor({ name, truth }: StudioScene) {
    const turned = ([a, b, c, d]: Rectangle): Rectangle => [a, b, -d, -c];
    this.#floors = truth.floors.map(({ x0x1z0z1 }) => turned(x0x1z0z1));
    this.#taken = truth.taken.map(turned);
    const ends = [0, 1, 2, 3].map((k) => (k % 2 ? Math.max : Math.min)(...this.#floors.map((each) => each[k])));
    this.#corner = [ends[0] - MARGIN, ends[2] - MARGIN];
    this.#size = [0, 2].map((k) => Math.ceil((ends[k + 1] - ends[k] + 2 * MARGIN) / CELL)) as [number, number];
    const count = this.#size[0] * this.#size[1];
    this.#heights = new Float32Array(count).fill(NaN);
    const solid = new Uint8Array(count);
    const floor = -truth.floors[0].y;
    for (const triangle of trianglesOf(name)) this.#add(triangle, floor, solid);
    this.#clearance = this.#distances(solid);
  }

  /** Compares a map with the reference. `from` is a place from which the body walks, meters. */
  compare(map: FloorMap, from: Point): FloorFound {
    const reached = this.#reached(this.#at(from[0], from[2]));
    const isFound = new Uint8Array(reached.length);
    const [nx] = this.#size;
    const areas = { outside: 0, taken: 0, beyond: 0 };
    const errors: number[] = [];
    for (const layer of map.layers)
      layer.forEach((height, i) => {
        if (Number.isNaN(height)) return;
        const x = map.corner[0] + ((i % map.width) + 0.5) * map.cell;
        const z = map.corner[1] + (Math.floor(i / map.width) + 0.5) * map.cell;
        const half = Math.round(map.cell / CELL / 2);
        for (let a = -half; a < half; a++)
          for (let b = -half; b < half; b++) isFound[this.#at(x + (a + 0.5) * CELL, z + (b + 0.5) * CELL)] = 1;
        const at = this.#at(x, z);
        // The edge of a step may be off by a cell of the map.
        const around = [-2, -1, 0, 1, 2].flatMap((a) => [-2, -1, 0, 1, 2].map((b) => at + a + nx * b));
        const isOn = around.some((place) => Math.abs(height - this.#heights[place]) < 0.15);
        const isFloor = this.#floors.some((each) => isIn(each, x, z));
        if (!isOn || this.#clearance[at] < IN_WALL) areas[height > STEP ? 'taken' : 'outside'] += map.cell ** 2;
        else if (!isFloor) areas.beyond += map.cell ** 2;
        else errors.push(Math.abs(height - this.#heights[at]));
      });
    let [free, found] = [0, 0];
    reached.forEach((isReached, at) => {
      const x = this.#corner[0] + ((at % nx) + 0.5) * CELL;
      const z = this.#corner[1] + (Math.floor(at / nx) + 0.5) * CELL;
      if (isReached === 0 || !this.#floors.some((each) => isIn(each, x, z))) return;
      if (this.#taken.some((each) => isIn(each, x, z))) return;
      free += CELL ** 2;
      found += isFound[at] * CELL ** 2;
    });
    return { ...areas, free, found, errors: errors.sort((a, b) => a - b) };
  }

  #at(x: number, z: number): number {
    const [i, j] = [x - this.#corner[0], z - this.#corner[1]].map((v) => Math.floor(v / CELL));
    return i >= 0 && i < this.#size[0] ? i + this.#size[0] * j : -1;
  }

  /** Marks what a triangle obstructs between a step and the height of a body, and the heights below: at points half a cell apart. */
  #add(corners: readonly Point[], floor: number, solid: Uint8Array): void {
    const ranges = [
      [this.#corner[0], this.#corner[0] + this.#size[0] * CELL],
      [floor - STEP, floor + HEIGHT],
      [this.#corner[1], this.#corner[1] + this.#size[1] * CELL],
    ];
    if (ranges.some(([low, high], k) => corners.every((p) => p[k] < low) || corners.every((p) => p[k] > high))) return;
    const turns = [0, 1, 2].map((k) => [corners[k], corners[(k + 1) % 3], corners[(k + 2) % 3]] as const);
    // Lines from the corner that is opposite of the shortest side.
    const [apex, from, to] = turns.sort((one, other) => distance(one[1], one[2]) - distance(other[1], other[2]))[0];
    const rows = Math.max(1, Math.ceil(distance(from, to) / (CELL / 2)));
    for (let row = 0; row <= rows; row++) {
      const way = [0, 1, 2].map((k) => from[k] + ((to[k] - from[k]) * row) / rows - apex[k]);
      const count = Math.max(1, Math.ceil(Math.hypot(...way) / (CELL / 2)));
      let [first, last] = [0, count];
      ranges.forEach((range, k) => {
        const ends = range.map((end) => (count * (end - apex[k])) / way[k]).sort((a, b) => a - b);
        if (!ends.every(Number.isFinite)) return;
        [first, last] = [Math.max(first, Math.ceil(ends[0])), Math.min(last, Math.floor(ends[1]))];
      });
      for (let k = first; k <= last; k++) {
        const at = this.#at(apex[0] + (way[0] * k) / count, apex[2] + (way[2] * k) / count);
        if (at < 0 || at >= solid.length) continue;
        const height = apex[1] + (way[1] * k) / count;
        if (height > floor + HEIGHT || height < floor - STEP) continue;
        if (height - floor > STEP + ROUNDING) solid[at] = 1;
        else if (!(this.#heights[at] > height)) this.#heights[at] = height;
      }
    }
  }

  #distances(solid: Uint8Array): Float32Array {
    const [nx] = this.#size;
    const clearance = new Float32Array(solid.length).fill(RADIUS);
    const reach = Math.ceil(RADIUS / CELL);
    solid.forEach((isSolid, at) => {
      if (isSolid === 0) return;
      for (let j = -reach; j <= reach; j++)
        for (let i = -reach; i <= reach; i++) {
          const to = at + i + nx * j;
          const distance = CELL * Math.max(0, Math.hypot(i, j) - 0.5);
          if (distance < (clearance[to] ?? 0)) clearance[to] = distance;
        }
    });
    return clearance;
  }

  /** Returns 1 for the cells that a body reaches from a cell. */
  #reached(start: number): Uint8Array {
    const [nx] = this.#size;
    const reached = new Uint8Array(this.#heights.length);
    reached[start] = 1;
    for (const open = [start]; open.length > 0;) {
      const at = open.pop()!;
      for (const to of [at - 1, at + 1, at - nx, at + nx])
        if (
          reached[to] === 0 &&
          this.#clearance[to] >= RADIUS &&
          Math.abs(this.#heights[to] - this.#heights[at]) <= STEP + ROUNDING
        ) {
          reached[to] = 1;
          open.push(to);
        }
    }
    return reached;
  }
}

const distance = (a: Point, b: Point): number => Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);

/** Yields the triangles of a scene's mesh, meters, y up; with objects, of those alone. */
export function* trianglesOf(name: string, objects?: (object: string) => boolean): Generator<readonly Point[]> {
  const folder = fileURLToPath(new URL(`../fixtures/studio/${name}/`, import.meta.url));
  const { mesh, objects: names } = JSON.parse(readFileSync(`${folder}truth.json`, 'utf8')) as {
    mesh: { points: number; triangles: number };
    objects: readonly string[];
  };
  const bytes = new Uint8Array(gunzipSync(readFileSync(`${folder}mesh.bin.gz`)));
  const points = new Float32Array(bytes.buffer, bytes.byteOffset, 3 * mesh.points);
  const corners = new Uint32Array(bytes.buffer, bytes.byteOffset + points.byteLength, 3 * mesh.triangles);
  const ids = bytes.subarray(points.byteLength + corners.byteLength);
  const pointOf = (i: number): Point => [points[3 * i], -points[3 * i + 1], -points[3 * i + 2]];
  for (let i = 0; i < corners.length; i += 3)
    if (!objects || objects(names[ids[i / 3]])) yield [...corners.subarray(i, i + 3)].map(pointOf);
}
