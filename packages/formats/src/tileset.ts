/** The tree of a 3D Tiles 1.0 or 1.1 tileset (OGC 22-025): the files and transforms of a level of detail. */
import { grouped } from './bytes.js';
import { damaged } from './faults.js';
import { multiply, type Affine } from './gltf/nodes.js';
import { implicitTile, propertiesOf, readImplicit, type SubtreeFiles } from './implicit-tiles.js';
import { failIn, isObject, parseJson, show, type FailAt, type Json, type JsonSource } from './json.js';
import { MAX_INDEX_BYTES } from './lod/meta.js';
import { scaleOf, TO_CLOUD, volumeOf } from './tile-volume.js';
import type { Tile, TileContent } from './tile.js';

const MAX_TILES = 100_000;
const MAX_DEPTH = 500;

const IDENTITY: Affine = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0];

/** Figures of all tilesets of one load. */
export interface TreeLoad {
  /** Number of tiles, which is limited. */
  tiles: number;
  /** Levels of tiles below the highest root: no level above this number is coarser. */
  height: number;
}

/** Counts a tile. Throws `decode/header` for too many. @param where Place of the tile in error messages. */
export function countTile(load: TreeLoad, where: string): void {
  if (++load.tiles > MAX_TILES) throw damaged(where, `at most ${grouped(MAX_TILES)} tiles`, 'more', 'decode/header');
}

/**
 * Parses a tileset. Returns its root; subtrees of implicit tiles are not read.
 * @param load Figures of all tilesets of a load, which this function updates.
 * @param folder Folder of the tileset, relative to the outermost one, with a `/` at its end; empty for that one itself.
 * @param toParent Transform from the coordinates of the tileset to those of the outermost one.
 * @throws GaussianSplatError `decode/header`, `decode/unsupported`, or as `parseJson` does
 */
export function parseTileset(source: JsonSource, load: TreeLoad, folder = '', toParent: Affine = IDENTITY): Tile {
  const { root, asset } = parseJson(source, MAX_INDEX_BYTES);
  const turn = turnOf(asset, source.name);
  const fail: FailAt = failIn(source.name);
  const open = (json: unknown, parent: Affine, isParentAdded: boolean, path: string, depth: number): Tile => {
    if (!isObject(json)) return fail(path, 'a tile', json);
    const where = `${source.name}, ${path}`;
    countTile(load, where);
    if (depth > MAX_DEPTH) fail(path, `tiles at most ${MAX_DEPTH} deep`, 'deeper ones');
    // Tiles without a transform share that of their parent, also in a message.
    const toTileset = json.transform === undefined ? parent : multiply(parent, transformOf(json, where));
    const isAdded =
      json.refine === undefined ? isParentAdded : /^add$/i.test(typeof json.refine === 'string' ? json.refine : '');
    const { boundingVolume, geometricError } = json;
    const error = Number.isFinite(geometricError) ? (geometricError as number) * scaleOf(toTileset) : Infinity;
    const volume = volumeOf(boundingVolume, multiply(TO_CLOUD, toTileset));
    const own = { isAdded, error, volume };
    const tiling = json.implicitTiling ?? extensionOf(json, '3DTILES_implicit_tiling');
    if (tiling !== undefined) {
      const root = { ...{ toTileset, turn, isAdded, error, folder, where, boundingVolume }, uris: urisOf(json) };
      return propertiesOf(implicitTile(tiling, root));
    }
    const children: unknown[] = Array.isArray(json.children) ? json.children : [];
    return {
      ...own,
      contents: urisOf(json).map((uri) => ({ uri: folder + uri, toTileset, ...(turn && { turn }) })),
      children: children.map((child, k) => open(child, toTileset, isAdded, `${path}.children[${k}]`, depth + 1)),
    };
  };
  return open(root, toParent, false, 'root', 0);
}

/**
 * Returns the files of a tileset at a level of detail. Level 0 is the finest; level n omits the n lowest levels of tiles
 * in each branch. Reads all subtrees of implicit tiles.
 * @throws GaussianSplatError as {@link parseTileset} and `readSubtree` do
 */
export async function contentsAt(
  root: Tile,
  level: number,
  load: TreeLoad,
  files: SubtreeFiles,
): Promise<TileContent[]> {
  const complete = async (tile: Tile): Promise<Tile> => {
    const own = tile.implicit ? await readImplicit(tile.implicit, load, files) : tile;
    const children: Tile[] = [];
    for (const child of own.children) children.push(await complete(child));
    return { ...own, children };
  };
  const { contents, height } = drawnOf(await complete(root), level);
  load.height = Math.max(load.height, height);
  return contents;
}

/** Rotations of glTF contents by their vertical axis, from the coordinates of contents whose vertical axis is y. */
const TURNS: Readonly<Record<string, Affine | undefined>> = {
  X: [0, 1, 0, 0, 0, 0, 1, 0, 1, 0, 0, 0],
  Y: undefined,
  Z: [1, 0, 0, 0, 0, 0, 1, 0, 0, -1, 0, 0],
};

/** Returns the rotation for the property `gltfUpAxis` of early tilesets; undefined for y, the default. */
function turnOf(asset: unknown, name: string): Affine | undefined {
  const axis = isObject(asset) ? (asset.gltfUpAxis ?? 'Y') : 'Y';
  const key = String(axis).toUpperCase();
  if (Object.hasOwn(TURNS, key)) return TURNS[key];
  throw damaged(`${name}, asset.gltfUpAxis`, 'X, Y or Z', show(axis), 'decode/unsupported');
}

/**
 * Returns the contents that are drawn for a tree at a level, and the height of the tree. Each is listed once, because lists of all tiles of a chain
 * would take memory by the square of its length.
 */
function drawnOf(tree: Tile, level: number): { readonly contents: TileContent[]; readonly height: number } {
  const drawn: TileContent[] = [];
  const draw = (contents: readonly TileContent[]): void => {
    for (const content of contents) drawn.push(content);
  };
  /** Lists the contents of a tile and those below it. Returns the height of its subtree; a leaf has height 0. */
  const visit = ({ contents, children, isAdded }: Tile): number => {
    const start = drawn.length;
    if (isAdded) draw(contents);
    const inner = drawn.length;
    let height = 0;
    for (const child of children) height = Math.max(height, visit(child) + 1);
    const isLowest = height <= level || drawn.length === inner;
    if (isLowest && contents.length > 0) {
      drawn.length = start;
      draw(contents);
    }
    return height;
  };
  const height = visit(tree);
  return { contents: drawn, height };
}

/** Returns an extension of a tile, with which version 1.0 has what version 1.1 has as a property. */
function extensionOf({ extensions }: Json, name: string): unknown {
  return isObject(extensions) ? extensions[name] : undefined;
}

/** Returns the URIs of a tile: `content` has one file, `contents` several. Drafts of the format use `url` for `uri`. */
function urisOf(tile: Json): string[] {
  const multiple = extensionOf(tile, '3DTILES_multiple_contents');
  const several = tile.contents ?? (isObject(multiple) ? (multiple.contents ?? multiple.content) : undefined);
  const all: unknown[] = Array.isArray(several) ? several : [tile.content];
  return all.flatMap((one) => {
    const uri = isObject(one) ? (one.uri ?? one.url) : undefined;
    return typeof uri === 'string' && uri !== '' ? [uri] : [];
  });
}

/** Returns the transform of a tile, which is a column-major 4x4 matrix in the file; the identity if absent. */
function transformOf({ transform }: Json, where: string): Affine {
  const m = transform as number[];
  if (!Array.isArray(transform) || m.length !== 16 || !m.every(Number.isFinite))
    throw damaged(`${where}.transform`, '16 numbers', show(transform), 'decode/header');
  return [m[0], m[4], m[8], m[12], m[1], m[5], m[9], m[13], m[2], m[6], m[10], m[14]];
}
