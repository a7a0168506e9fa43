/** Implicit tiles of 3D Tiles (OGC 22-025, section 8): regular trees whose tiles are listed by bits in subtree files. */
import { grouped, startsWith, viewOf } from './bytes.js';
import { damaged } from './faults.js';
import { multiply, type Affine } from './gltf/nodes.js';
import { isObject, parseJson, show, type Json, type JsonSource } from './json.js';
import { MAX_PATH } from './lod/meta.js';
import type { Tile } from './tile.js';
import { countTile, type TreeLoad } from './tileset.js';
import { partOfVolume, TO_CLOUD, volumeOf } from './tile-volume.js';

/** Opens a file by its URI from the outermost tileset. */
export type OpenSubtree = (uri: string) => Promise<Uint8Array>;

/** Access to subtrees. */
export interface SubtreeFiles extends Pick<JsonSource, 'name' | 'budget'> {
  readonly openSubtree: OpenSubtree;
  /** Subtrees that have been read, by their URIs. */
  readonly subtrees: Map<string, Promise<Subtree>>;
}

/** Properties of the root of implicit tiles. Plain data, as {@link ImplicitTile} is. */
interface ImplicitRoot {
  /** Templates of the URIs of its contents. */
  readonly uris: readonly string[];
  readonly toTileset: Affine;
  readonly turn: Affine | undefined;
  readonly isAdded: boolean;
  /** Geometric error; each level halves it. */
  readonly error: number;
  /** Value in the JSON, in the coordinates of the tile. */
  readonly boundingVolume: unknown;
  /** Folder of the tileset, relative to the outermost one. */
  readonly folder: string;
  /** Place of the root in error messages. */
  readonly where: string;
}

interface TreeShape {
  /** Number of divided axes: 2 or 3. A tile has 4 or 8 children. */
  readonly axes: number;
  readonly subtreeLevels: number;
  readonly levels: number;
  /** Template of the URIs of subtrees. */
  readonly template: string;
}

/** An implicit tile whose subtree has not been read for its contents and children. */
export interface ImplicitTile extends Place {
  readonly root: ImplicitRoot;
  readonly shape: TreeShape;
  /** Highest tile of its subtree. */
  readonly top: Place;
  /** Index of the tile in its level of the subtree. */
  readonly morton: number;
}

/** Maximum level of a tile, and bits of an index in a subtree, so that both are exact integers. */
const MAX_LEVEL = 50;
const MAX_INDEX_BITS = 50;
/** Maximum number of contents of a tile. */
const MAX_CONTENTS = 64;
/** Bytes that are charged for each content, besides its address. */
const CONTENT_BYTES = 64;
const MAX_SUBTREE_BYTES = 1 << 26;
/** Bytes of the head of a binary subtree: magic number, version, and two lengths of 64 bits. */
const HEAD_BYTES = 24;

/** Level and coordinates of a tile in the whole tree. */
interface Place {
  readonly level: number;
  readonly x: number;
  readonly y: number;
  readonly z: number;
}

/** Returns whether the tile, content or child with an index exists. */
type Availability = (index: number) => boolean;

export interface Subtree {
  /** Tiles by level, then by Morton index. */
  readonly tiles: Availability;
  /** For each content of a tile, the tiles that have it. */
  readonly contents: readonly Availability[];
  /** Subtrees below the lowest level, by Morton index. */
  readonly children: Availability;
}

/**
 * Returns the highest implicit tile of a tileset.
 * @param json The property `implicitTiling` of the tile.
 * @throws GaussianSplatError `decode/header`
 */
export function implicitTile(json: unknown, root: ImplicitRoot): ImplicitTile {
  const fail = (path: string, expected: string, found: unknown): never => {
    throw damaged(`${root.where}.implicitTiling.${path}`, expected, show(found), 'decode/header');
  };
  const tiling = isObject(json) ? json : {};
  const { subdivisionScheme, subtreeLevels, subtrees } = tiling;
  // Version 1.0 has the highest level in place of the number of levels.
  const levels = tiling.availableLevels ?? Number(tiling.maximumLevel) + 1;
  const axes = subdivisionScheme === 'QUADTREE' ? 2 : subdivisionScheme === 'OCTREE' ? 3 : undefined;
  if (axes === undefined) return fail('subdivisionScheme', 'QUADTREE or OCTREE', subdivisionScheme);
  const isLevel = (value: unknown): value is number =>
    Number.isInteger(value) && (value as number) >= 1 && (value as number) <= MAX_LEVEL;
  const max = Math.floor(MAX_INDEX_BITS / axes);
  if (!isLevel(subtreeLevels) || subtreeLevels > max) return fail('subtreeLevels', `1 to ${max}`, subtreeLevels);
  if (!isLevel(levels)) return fail('availableLevels', `1 to ${MAX_LEVEL}`, levels);
  const template = isObject(subtrees) ? subtrees.uri : undefined;
  const isTemplate = typeof template === 'string' && ['{level}', '{x}', '{y}'].every((key) => template.includes(key));
  if (!isTemplate) return fail('subtrees.uri', 'an address with {level}, {x} and {y}', template);
  if (root.uris.length > MAX_CONTENTS) return fail('content', `at most ${MAX_CONTENTS} files`, root.uris.length);
  if ([template, ...root.uris].some(({ length }) => length > MAX_PATH))
    return fail('subtrees.uri', `addresses of at most ${grouped(MAX_PATH)} characters`, 'longer ones');
  const top = { level: 0, x: 0, y: 0, z: 0 };
  return { ...top, top, morton: 0, root, shape: { axes, subtreeLevels, levels, template } };
}

/**
 * Reads the subtree of an implicit tile. Returns the tile with its contents, and with children that are implicit tiles.
 * @throws GaussianSplatError `decode/header`, `decode/corrupt`, `decode/truncated`, or as `openSubtree` does
 */
export async function readImplicit(tile: ImplicitTile, load: TreeLoad, files: SubtreeFiles): Promise<Tile> {
  const { root, shape, top, morton, level } = tile;
  const { axes, subtreeLevels, levels, template } = shape;
  const { toTileset, turn } = root;
  const branches = 2 ** axes;
  countTile(load, root.where);
  const uri = root.folder + filled(template, top);
  const reading = files.subtrees.get(uri) ?? readSubtree(uri, root.uris.length, files);
  files.subtrees.set(uri, reading);
  const subtree = await reading;
  const depth = level - top.level;
  const isThere = (own: Availability): boolean => own(firstOf(depth, branches) + morton);
  const children: Tile[] = [];
  const contents = isThere(subtree.tiles)
    ? root.uris
        .filter((_, k) => isThere(subtree.contents[k]))
        .map((one) => ({ uri: root.folder + filled(one, tile), toTileset, ...(turn && { turn }) }))
    : [];
  for (const content of contents) files.budget.take(CONTENT_BYTES + 2 * content.uri.length, files.name);
  for (let k = 0; k < branches && isThere(subtree.tiles) && level + 1 < levels; k++) {
    const [x, y, z] = [tile.x, tile.y, tile.z].map((value, axis) => 2 * value + ((k >> axis) & 1));
    const below = { level: level + 1, x, y, z };
    const own = branches * morton + k;
    const isInner = depth + 1 < subtreeLevels;
    if (!(isInner ? subtree.tiles(firstOf(depth + 1, branches) + own) : subtree.children(own))) continue;
    const place = isInner ? { top, morton: own } : { top: below, morton: 0 };
    children.push(propertiesOf({ ...below, ...place, root, shape }));
  }
  return { ...propertiesOf(tile), contents, children, implicit: undefined };
}

/** Returns an implicit tile as a tile without contents and children. */
export function propertiesOf(implicit: ImplicitTile): Tile {
  const { root, shape, level } = implicit;
  const { isAdded, error, boundingVolume, toTileset } = root;
  const part = partOfVolume(boundingVolume, implicit, shape.axes);
  const volume = volumeOf(part, multiply(TO_CLOUD, toTileset));
  return { isAdded, error: error / 2 ** level, volume, contents: [], children: [], implicit };
}

/** Index of the first tile of a level in a subtree. */
const firstOf = (depth: number, branches: number): number => (branches ** depth - 1) / (branches - 1);

const filled = (template: string, place: Place): string =>
  template.replace(/\{(level|x|y|z)\}/g, (_, key: keyof Place) => String(place[key]));

/** Reads a subtree, which is JSON, or binary with JSON and a buffer in it. */
async function readSubtree(
  uri: string,
  contents: number,
  { name, budget, openSubtree: open }: SubtreeFiles,
): Promise<Subtree> {
  const bytes = await open(uri);
  const where = `${name}, ${uri}`;
  const { text, binary } = chunksOf(bytes, where);
  const json = parseJson({ bytes: text, name: where, budget }, MAX_SUBTREE_BYTES);
  const folder = uri.slice(0, uri.lastIndexOf('/') + 1);
  /** Files of buffers. Each is opened once, because a subtree has a view of them for each content of a tile. */
  const files = new Map<string, Promise<Uint8Array>>();
  const openOnce = (file: string): Promise<Uint8Array> => {
    const opened = files.get(file) ?? open(folder + file);
    files.set(file, opened);
    return opened;
  };
  const availability = async (own: unknown, key: string): Promise<Availability> => {
    const { constant, bitstream, bufferView = bitstream } = isObject(own) ? own : {};
    if (bufferView === undefined) return () => constant === 1;
    const bits = await viewIn(json, bufferView, binary, `${where}, ${key}`, openOnce);
    // Indices may exceed 32 bits.
    return (index) => (((bits[Math.floor(index / 8)] ?? 0) >> (index % 8)) & 1) === 1;
  };
  const { tileAvailability, contentAvailability, childSubtreeAvailability } = json;
  const ofContents: unknown[] = Array.isArray(contentAvailability) ? contentAvailability : [contentAvailability];
  const found: Availability[] = [];
  for (let k = 0; k < contents; k++) found.push(await availability(ofContents[k], 'contentAvailability'));
  return {
    tiles: await availability(tileAvailability, 'tileAvailability'),
    contents: found,
    children: await availability(childSubtreeAvailability, 'childSubtreeAvailability'),
  };
}

function chunksOf(bytes: Uint8Array, where: string): { text: Uint8Array; binary: Uint8Array } {
  if (!startsWith(bytes, 'subt')) return { text: bytes, binary: new Uint8Array() };
  const view = viewOf(bytes);
  const [length, rest] = bytes.length < HEAD_BYTES ? [0, 0] : [8, 16].map((at) => Number(view.getBigUint64(at, true)));
  const end = HEAD_BYTES + length + rest;
  if (end > bytes.length) throw damaged(where, `${grouped(end)} bytes`, grouped(bytes.length), 'decode/truncated');
  return {
    text: bytes.subarray(HEAD_BYTES, HEAD_BYTES + length),
    binary: bytes.subarray(HEAD_BYTES + length, end),
  };
}

/** Returns the bytes of a view of a buffer, which is the binary chunk or another file. */
async function viewIn(
  { buffers, bufferViews }: Json,
  index: unknown,
  binary: Uint8Array,
  where: string,
  open: (file: string) => Promise<Uint8Array>,
): Promise<Uint8Array> {
  const item = (list: unknown, at: unknown): Json => {
    const found: unknown = Array.isArray(list) && Number.isInteger(at) ? list[at as number] : undefined;
    if (isObject(found)) return found;
    throw damaged(where, 'a view of a buffer', show(at), 'decode/header');
  };
  const { buffer, byteOffset = 0, byteLength } = item(bufferViews, index);
  const { uri } = item(buffers, buffer);
  const bytes = typeof uri === 'string' ? await open(uri) : binary;
  const [first, length] = [byteOffset, byteLength] as number[];
  const isWithin = Number.isInteger(first) && Number.isInteger(length) && first >= 0 && length >= 0;
  if (isWithin && first + length <= bytes.length) return bytes.subarray(first, first + length);
  throw damaged(where, `bytes within ${grouped(bytes.length)}`, show([byteOffset, byteLength]), 'decode/corrupt');
}
