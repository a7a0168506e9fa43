/** The tree of a tileset of 3D Tiles 1.0 and 1.1 (OGC 22-025): which files are drawn at a level of detail, and where. */
import { grouped } from './bytes.js';
import { damaged } from './faults.js';
import { multiply, type Affine } from './gltf/nodes.js';
import { isObject, parseJson, show, type Json, type JsonSource } from './json.js';
import { MAX_INDEX_BYTES } from './lod/meta.js';

const MAX_TILES = 100_000;
const MAX_DEPTH = 500;

/** A file that a tile names. */
export interface TileContent {
  /** As the tileset writes it, with its query. */
  readonly uri: string;
  /** From the frame of its tile, whose third axis points up, to the tileset's. */
  readonly toTileset: Affine;
}

/** The tile itself, or those below it that replace it. */
interface Tile {
  readonly contents: readonly TileContent[];
  readonly children: readonly Tile[];
  /** It is drawn beside its children, too. */
  readonly isAdded: boolean;
}

const IDENTITY: Affine = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0];

/**
 * The files that show a tileset at a level: 0 is the finest, and each further one leaves out the lowest tiles of all branches.
 * @param load counts the tiles of all tilesets of a load, which share one limit
 * @param toParent from the tileset's frame to that of the one which names it
 */
export function contentsAt(
  source: JsonSource,
  level: number,
  load: { tiles: number },
  toParent: Affine = IDENTITY,
): TileContent[] {
  const { root } = parseJson(source, MAX_INDEX_BYTES);
  const fail = (path: string, expected: string, found: unknown): never => {
    throw damaged(`${source.name}, ${path}`, expected, show(found), 'decode/header');
  };
  const open = (json: unknown, parent: Affine, isParentAdded: boolean, path: string, depth: number): Tile => {
    if (!isObject(json)) return fail(path, 'a tile', json);
    if (++load.tiles > MAX_TILES) fail(path, `at most ${grouped(MAX_TILES)} tiles`, 'more');
    if (depth > MAX_DEPTH) fail(path, `tiles at most ${MAX_DEPTH} deep`, 'deeper ones');
    if (json.implicitTiling !== undefined)
      throw damaged(`${source.name}, ${path}`, 'tiles that are listed', 'implicit tiling', 'decode/unsupported');
    const toTileset = multiply(parent, transformOf(json, `${source.name}, ${path}`));
    const isAdded = json.refine === undefined ? isParentAdded : String(json.refine).toUpperCase() === 'ADD';
    const children: unknown[] = Array.isArray(json.children) ? json.children : [];
    return {
      contents: urisOf(json).map((uri) => ({ uri, toTileset })),
      children: children.map((child, k) => open(child, toTileset, isAdded, `${path}.children[${k}]`, depth + 1)),
      isAdded,
    };
  };
  return drawnOf(open(root, toParent, false, 'root', 0), level).contents;
}

/** What is drawn of a tile, and how many levels lie below it. */
function drawnOf(tile: Tile, level: number): { contents: TileContent[]; height: number } {
  const below = tile.children.map((child) => drawnOf(child, level));
  const height = below.reduce((most, child) => Math.max(most, child.height + 1), 0);
  const inner = below.flatMap(({ contents }) => contents);
  const isLowest = height <= level || inner.length === 0;
  if (isLowest && tile.contents.length > 0) return { contents: [...tile.contents], height };
  return { contents: tile.isAdded ? [...tile.contents, ...inner] : inner, height };
}

/** `content` of one file, `contents` of several; `url` is the name of drafts. */
function urisOf({ content, contents }: Json): string[] {
  const all: unknown[] = Array.isArray(contents) ? contents : [content];
  return all.flatMap((one) => {
    const uri = isObject(one) ? (one.uri ?? one.url) : undefined;
    return typeof uri === 'string' && uri !== '' ? [uri] : [];
  });
}

/** Column by column in the file. */
function transformOf({ transform }: Json, where: string): Affine {
  if (transform === undefined) return IDENTITY;
  const m = transform as number[];
  if (!Array.isArray(transform) || m.length !== 16 || !m.every(Number.isFinite))
    throw damaged(`${where}.transform`, '16 numbers', show(transform), 'decode/header');
  return [m[0], m[4], m[8], m[12], m[1], m[5], m[9], m[13], m[2], m[6], m[10], m[14]];
}
