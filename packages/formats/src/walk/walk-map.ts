import { GaussianSplatError } from '@gaussian-splat/core';
import { gunzipSync, gzipSync } from 'fflate';

/**
 * The walkable floor: for each cell of a horizontal grid the heights that fit a body. Coordinates with y up, lengths in
 * meters. A cell has several heights if floors overlap, as on stairs and galleries.
 */
export interface WalkMap {
  /** Edge of a cell, meters. */
  readonly cell: number;
  /** Corner of the first cell, meters. */
  readonly corner: readonly [x: number, z: number];
  readonly width: number;
  readonly depth: number;
  /** Layers of [depth, width] heights in meters, x innermost; NaN without a floor. */
  readonly layers: readonly Float32Array[];
  /** Maximum step height between neighboring cells, meters. */
  readonly step: number;
  /** Start of the walk: the position on the floor nearest to the requested point. */
  readonly start: readonly [x: number, y: number, z: number];
  /** Area of the floor, m². */
  readonly area: number;
}

/**
 * Returns the height of the floor at a point, within one step of the height `near`; undefined if a body cannot stand
 * there.
 */
export function floorAt(map: WalkMap, x: number, z: number, near: number): number | undefined {
  const i = Math.floor((x - map.corner[0]) / map.cell);
  const j = Math.floor((z - map.corner[1]) / map.cell);
  if (!(i >= 0 && j >= 0 && i < map.width && j < map.depth)) return undefined;
  let best: number | undefined;
  for (const layer of map.layers) {
    const height = layer[i + map.width * j];
    const isCloser = best === undefined || Math.abs(height - near) < Math.abs(best - near);
    if (Math.abs(height - near) <= map.step && isCloser) best = height;
  }
  return best;
}

/**
 * Moves one step on the floor. A body that meets a wall slides along it.
 * @param from x, height of the floor, z: meters.
 * @returns The new position; the same array if the body is blocked.
 */
export function stepOn(
  map: WalkMap,
  from: readonly [number, number, number],
  dx: number,
  dz: number,
): readonly [number, number, number] {
  const [x, y, z] = from;
  for (const [toX, toZ] of [
    [x + dx, z + dz],
    [x + dx, z],
    [x, z + dz],
  ]) {
    if (toX === x && toZ === z) continue;
    const height = walkTo(map, x, y, z, toX, toZ);
    if (height !== undefined) return [toX, height, toZ];
  }
  return from;
}

/** Follows the floor from cell to cell; undefined if it ends on the way. */
function walkTo(map: WalkMap, x: number, y: number, z: number, toX: number, toZ: number): number | undefined {
  const pieces = Math.max(1, Math.ceil(Math.max(Math.abs(toX - x), Math.abs(toZ - z)) / map.cell));
  let height: number | undefined = y;
  for (let k = 1; k <= pieces && height !== undefined; k++)
    height = floorAt(map, x + ((toX - x) * k) / pieces, z + ((toZ - z) * k) / pieces, height);
  return height;
}

/**
 * Finds the shortest path over the floor between two positions, by breadth-first search over cells, eight neighbors
 * each.
 * @returns Positions from cell to cell, the last at the end of the path; empty if there is none.
 */
export function wayTo(
  map: WalkMap,
  from: readonly [number, number, number],
  to: readonly [number, number, number],
): readonly (readonly [number, number, number])[] {
  const { cell, corner, width } = map;
  const cellOf = (x: number, z: number): number =>
    Math.floor((x - corner[0]) / cell) + width * Math.floor((z - corner[1]) / cell);
  const middle = (index: number): [number, number] => [
    corner[0] + ((index % width) + 0.5) * cell,
    corner[1] + (Math.floor(index / width) + 0.5) * cell,
  ];
  const goal = cellOf(to[0], to[2]);
  const visited = new Map<string, { readonly place: readonly [number, number, number]; readonly before?: string }>();
  const keyOf = (index: number, y: number): string => `${index} ${Math.round(y / map.step)}`;
  const first = keyOf(cellOf(from[0], from[2]), from[1]);
  visited.set(first, { place: from });
  const queue = [first];
  for (let head = 0; head < queue.length; head++) {
    const key = queue[head];
    const [x, y, z] = visited.get(key)!.place;
    const index = cellOf(x, z);
    if (index === goal && Math.abs(y - to[1]) <= map.step) return back(visited, key, to);
    for (const [i, j] of NEIGHBORS) {
      const next = index + i + width * j;
      const [toX, toZ] = middle(next);
      const height = floorAt(map, toX, toZ, y);
      const isCorner = i !== 0 && j !== 0;
      if (height === undefined) continue;
      // A diagonal step needs both adjacent cells, because a body does not cut corners.
      if (isCorner && (!isFree(map, middle(index + i), y) || !isFree(map, middle(index + width * j), y))) continue;
      const nextKey = keyOf(next, height);
      if (visited.has(nextKey)) continue;
      visited.set(nextKey, { place: [toX, height, toZ], before: key });
      queue.push(nextKey);
    }
  }
  return [];
}

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

const isFree = (map: WalkMap, [x, z]: readonly [number, number], near: number): boolean =>
  floorAt(map, x, z, near) !== undefined;

function back(
  visited: ReadonlyMap<string, { readonly place: readonly [number, number, number]; readonly before?: string }>,
  last: string,
  to: readonly [number, number, number],
): readonly (readonly [number, number, number])[] {
  const way: (readonly [number, number, number])[] = [to];
  for (let key = visited.get(last)!.before; key !== undefined; key = visited.get(key)!.before)
    way.push(visited.get(key)!.place);
  way.pop();
  return way.reverse();
}

const FORMAT = 'gaussian-splat-walk-map';
const VERSION = 1;
/** The int16 that marks a missing floor. */
const NO_FLOOR = -0x8000;
/** Smallest unit of stored heights, meters. */
const HEIGHT_UNIT = 0.01;
/** Maximum unpacked size of a file: 64 MB. */
const MAX_BYTES = 2 ** 26;

/**
 * Encodes a `.floor` file: gzip of one line of JSON and, layer by layer, int16 differences along rows, in units of
 * `heightUnit` meters.
 */
export function encodeWalkMap(map: WalkMap): Uint8Array {
  const { layers, ...rest } = map;
  let highest = 0;
  for (const layer of layers) for (const height of layer) if (Math.abs(height) > highest) highest = Math.abs(height);
  const heightUnit = Math.max(HEIGHT_UNIT, highest / 0x3fff);
  const head = JSON.stringify({ format: FORMAT, version: VERSION, ...rest, layers: layers.length, heightUnit });
  const start = new TextEncoder().encode(`${head}\n`);
  const bytes = new Uint8Array(start.length + 2 * layers.length * map.width * map.depth);
  bytes.set(start);
  const view = new DataView(bytes.buffer, start.length);
  let at = 0;
  for (const layer of layers) {
    let before = 0;
    for (const height of layer) {
      const value = Number.isNaN(height) ? NO_FLOOR : Math.round(height / heightUnit);
      const isFloor = value !== NO_FLOOR;
      view.setInt16(at, isFloor ? value - before : NO_FLOOR, true);
      if (isFloor) before = value;
      at += 2;
    }
  }
  return gzipSync(bytes, { level: 9, mtime: 0 });
}

/**
 * Reads a `.floor` file.
 * @param name Name of the file in errors.
 * @throws GaussianSplatError `decode/corrupt`
 */
export function decodeWalkMap(file: Uint8Array, name = 'walk map'): WalkMap {
  const fail = (expected: string, found: string): never => {
    throw new GaussianSplatError('decode/corrupt', {
      where: name,
      expected,
      found,
      remedy: 'write the file with gaussian-splat floor, or leave the attribute walk-map out',
    });
  };
  let bytes = new Uint8Array();
  try {
    const length = new DataView(file.buffer, file.byteOffset + file.length - 4, 4).getUint32(0, true);
    if (length > MAX_BYTES) fail(`at most ${MAX_BYTES} bytes`, String(length));
    bytes = gunzipSync(file, { out: new Uint8Array(length) });
  } catch (error) {
    if (error instanceof GaussianSplatError) throw error;
    fail('a gzip file', (error as Error).message);
  }
  const end = bytes.indexOf(10);
  let head: Partial<Omit<WalkMap, 'layers'>> & {
    format?: string;
    version?: number;
    layers?: number;
    heightUnit?: number;
  } = {};
  try {
    head = JSON.parse(new TextDecoder().decode(bytes.subarray(0, Math.max(0, end)))) as typeof head;
  } catch {
    fail('a line of JSON', 'none');
  }
  const { format, version, cell, corner, width, depth, layers, step, start, area, heightUnit } = head ?? {};
  if (format !== FORMAT || version !== VERSION)
    fail(`format ${FORMAT}, version ${VERSION}`, `format ${format}, version ${version}`);
  const numbers = [cell, step, area, heightUnit, ...(corner ?? []), ...(start ?? [])];
  const counts = [width, depth, layers];
  const isWhole =
    numbers.length === 9 &&
    numbers.every((value) => Number.isFinite(value)) &&
    cell! > 0 &&
    step! > 0 &&
    counts.every((value) => Number.isSafeInteger(value) && value! >= 0);
  if (!isWhole)
    fail('finite numbers for cell, corner, width, depth, layers, step, start and area', JSON.stringify(head));
  const cells = width! * depth!;
  const expected = 2 * layers! * cells;
  if (bytes.length - end - 1 !== expected) fail(`${expected} bytes of heights`, String(bytes.length - end - 1));
  const view = new DataView(bytes.buffer, bytes.byteOffset + end + 1);
  const read = (layer: number): Float32Array => {
    let before = 0;
    return Float32Array.from({ length: cells }, (_, i) => {
      const value = view.getInt16(2 * (layer * cells + i), true);
      if (value === NO_FLOOR) return NaN;
      before += value;
      return before * heightUnit!;
    });
  };
  return {
    cell: cell!,
    corner: corner!,
    width: width!,
    depth: depth!,
    layers: Array.from({ length: layers! }, (_, layer) => read(layer)),
    step: step!,
    start: start!,
    area: area!,
  };
}
