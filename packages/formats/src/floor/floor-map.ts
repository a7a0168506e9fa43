import { GaussianSplatError } from '@gaussian-splat/core';
import { gzipSync } from 'fflate';
import { LoadBudget, type LoadLimits } from '../budget.js';
import { inflateUpTo } from '../inflate.js';
import { parseJson } from '../json.js';

/**
 * Walkable floor of a scene: heights of the floor that fit a body, for each cell of a horizontal grid. Coordinates have y up,
 * in meters. A cell has several heights if floors overlap, as on stairs and galleries.
 */
export interface FloorMap {
  /** Edge of a cell in meters. */
  readonly cell: number;
  /** Corner of the first cell with the smallest coordinates, in meters. */
  readonly corner: readonly [x: number, z: number];
  /** Number of cells along x. */
  readonly width: number;
  /** Number of cells along z. */
  readonly depth: number;
  /** Layers of heights in meters, [depth, width] each; NaN for cells without another floor. */
  readonly layers: readonly Float32Array[];
  /** Maximum difference in height of a step between neighboring cells, in meters. */
  readonly step: number;
  /** Start of the walk in meters: the position on the floor that is nearest to the requested point. */
  readonly start: readonly [x: number, y: number, z: number];
  /** Area of the floor in m². */
  readonly area: number;
}

/**
 * Returns the height of the floor at a point that is nearest to the height `near`, in meters. Undefined if there is no
 * floor within `map.step` of `near`.
 */
export function floorAt(map: FloorMap, x: number, z: number, near: number): number | undefined {
  const place = placeAt(map, columnOf(map, x), rowOf(map, z), near);
  return place < 0 ? undefined : heightOf(map, place);
}

export const columnOf = ({ corner, cell }: FloorMap, x: number): number => Math.floor((x - corner[0]) / cell);
export const rowOf = ({ corner, cell }: FloorMap, z: number): number => Math.floor((z - corner[1]) / cell);

/**
 * Returns the place in a cell whose height is nearest to `near`: its layer, times the number of cells, plus the index of
 * the cell. Returns -1 if there is no floor within `map.step` of `near`.
 */
export function placeAt({ width, depth, layers, step }: FloorMap, column: number, row: number, near: number): number {
  if (!(column >= 0 && row >= 0 && column < width && row < depth)) return -1;
  const index = column + width * row;
  let best = -1;
  let distance = step;
  for (let layer = 0; layer < layers.length; layer++) {
    const off = Math.abs(layers[layer][index] - near);
    if (!(off < distance || (off === distance && best < 0))) continue;
    distance = off;
    best = index + width * depth * layer;
  }
  return best;
}

export const heightOf = ({ width, depth, layers }: FloorMap, place: number): number =>
  layers[Math.floor(place / (width * depth))][place % (width * depth)];

/**
 * Moves a body on the floor by (dx, dz) meters. A body that meets a wall slides along the wall.
 * @param from Position (x, height of the floor, z) in meters.
 * @returns The new position; the same array if the body is blocked.
 */
export function stepOn(
  map: FloorMap,
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

/** Maximum number of pieces of a movement. Longer ones skip cells. */
const MAX_PIECES = 4096;

/** Returns the height of the floor at the end of a straight movement; undefined if the floor ends before. */
function walkTo(map: FloorMap, x: number, y: number, z: number, toX: number, toZ: number): number | undefined {
  const cells = Math.ceil(Math.max(Math.abs(toX - x), Math.abs(toZ - z)) / map.cell);
  const pieces = Math.min(MAX_PIECES, Math.max(1, cells));
  let height: number | undefined = y;
  for (let k = 1; k <= pieces && height !== undefined; k++)
    height = floorAt(map, x + ((toX - x) * k) / pieces, z + ((toZ - z) * k) / pieces, height);
  return height;
}

const FORMAT = 'gaussian-splat-walk-map';
const VERSION = 1;
/** Value of int16 for cells without a floor. */
const NO_FLOOR = -0x8000;
/** Minimum unit of stored heights in meters. */
const HEIGHT_UNIT = 0.01;
/** Maximum uncompressed size of a file in bytes. */
const MAX_BYTES = 2 ** 26;
/** Maximum size of the line of JSON, in bytes. */
const MAX_HEAD_BYTES = 1024;
/** Maximum number of layers of a file. Layers of few cells would take much more memory than their bytes. */
const MAX_LAYERS = 1024;
/** Minimum edge of a cell, and maximum of the edge and of a step, in meters. */
const [MIN_CELL, MAX_CELL] = [1e-3, 1e3];
/** Bytes of memory for each height: in the file, in its layer, and in the search for a path. */
const BYTES_PER_HEIGHT = 10;

/**
 * Returns the bytes of a `.floor` file: gzip of one line of JSON, followed by the heights of all layers. Heights are int16
 * differences from the previous height, in units of `heightUnit` meters.
 * @throws GaussianSplatError `argument/value` for a map that {@link decodeFloorMap} would refuse for its size.
 */
export function encodeFloorMap(map: FloorMap): Uint8Array {
  const { layers, ...rest } = map;
  const heightBytes = 2 * layers.length * map.width * map.depth;
  if (layers.length > MAX_LAYERS || heightBytes > MAX_BYTES - MAX_HEAD_BYTES)
    throw new GaussianSplatError('argument/value', {
      where: 'map of a floor',
      expected: `at most ${MAX_LAYERS} floors above each other, and ${MAX_BYTES} bytes`,
      found: `${layers.length} floors and ${heightBytes} bytes`,
      remedy: 'use a larger cell; check the unit of the scene',
    });
  let highest = 0;
  for (const layer of layers) for (const height of layer) if (Math.abs(height) > highest) highest = Math.abs(height);
  const heightUnit = Math.max(HEIGHT_UNIT, highest / 0x3fff);
  const head = JSON.stringify({ format: FORMAT, version: VERSION, ...rest, layers: layers.length, heightUnit });
  const start = new TextEncoder().encode(`${head}\n`);
  const bytes = new Uint8Array(start.length + heightBytes);
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

/** Returns a list of `count` values; NaN instead of any other value. */
const numbersOf = (value: unknown, count: number): readonly unknown[] =>
  Array.isArray(value) && value.length === count ? (value as unknown[]) : [NaN];

/**
 * Reads a `.floor` file.
 * @param name Name of the file in error messages.
 * @throws GaussianSplatError `decode/corrupt`, `decode/truncated`, `decode/header`, `out-of-memory/budget`
 */
export function decodeFloorMap(file: Uint8Array, name = 'walk map', limits: LoadLimits = {}): FloorMap {
  const budget = new LoadBudget(file.length, limits);
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
    budget.take((BYTES_PER_HEIGHT / 2) * length, name);
    bytes = inflateUpTo(file, length);
  } catch (error) {
    if (error instanceof GaussianSplatError) throw error;
    fail('a gzip file', (error as Error).message);
  }
  const end = bytes.indexOf(10);
  if (end < 0) fail('a line of JSON', 'none');
  const head = parseJson({ bytes: bytes.subarray(0, end), name, budget }, MAX_HEAD_BYTES) as Partial<
    Omit<FloorMap, 'layers'>
  > & { format?: string; version?: number; layers?: number; heightUnit?: number };
  const { format, version, cell, corner, width, depth, layers, step, start, area, heightUnit } = head;
  if (format !== FORMAT || version !== VERSION)
    fail(`format ${FORMAT}, version ${VERSION}`, JSON.stringify({ format, version }).slice(0, 200));
  const numbers = [cell, step, area, heightUnit, ...numbersOf(corner, 2), ...numbersOf(start, 3)];
  const counts = [width, depth, layers];
  const isWhole =
    numbers.every((value) => Number.isFinite(value)) &&
    cell! >= MIN_CELL &&
    cell! <= MAX_CELL &&
    step! > 0 &&
    step! <= MAX_CELL &&
    counts.every((value) => Number.isSafeInteger(value) && value! >= 0) &&
    layers! <= MAX_LAYERS;
  if (!isWhole)
    fail(
      'finite numbers for cell, corner, width, depth, layers, step, start and area',
      JSON.stringify(head).slice(0, 200),
    );
  const cells = width! * depth!;
  const expected = 2 * layers! * cells;
  // Layers without cells take no bytes, so that their number would be unlimited.
  if (bytes.length - end - 1 !== expected || layers! > expected)
    fail(`${expected} bytes of heights`, String(bytes.length - end - 1));
  const view = new DataView(bytes.buffer, bytes.byteOffset + end + 1);
  const read = (layer: number): Float32Array => {
    const heights = new Float32Array(cells).fill(NaN);
    for (let i = 0, height = 0; i < cells; i++) {
      const difference = view.getInt16(2 * (layer * cells + i), true);
      if (difference !== NO_FLOOR) heights[i] = (height += difference) * heightUnit!;
    }
    return heights;
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
