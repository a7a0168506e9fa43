/** 3D Tiles, tile by tile. */
import type { GaussianCloud } from '@gaussian-splat/core';
import { refuse } from '../budget.js';
import { grouped } from '../bytes.js';
import { damaged, warn } from '../faults.js';
import { readImplicit, type SubtreeFiles } from '../implicit-tiles.js';
import { MAX_PATH } from '../lod/meta.js';
import { mergeClouds } from '../merge-clouds.js';
import { isTileset } from '../readers/gltf.js';
import { folderOf, MAX_NESTED, openPart, readContent, upAt } from '../readers/tiles.js';
import type { Tile } from '../tile.js';
import { parseTileset, type TreeLoad } from '../tileset.js';
import type { ReadNode, SceneTree, TreeFiles, TreeReader } from './types.js';

async function open(bytes: Uint8Array, files: TreeFiles): Promise<SceneTree> {
  const load: TreeLoad = { tiles: 0, height: 0 };
  const root = parseTileset({ bytes, name: files.name, budget: files.budget }, load);
  requireWeight(load, bytes, files.name);
  const up = root.volume && upAt([root.volume[0], root.volume[1], root.volume[2]]);
  return {
    ...{ container: 'tiles', facts: undefined, roots: [root], isDescended: true, isComplete: isComplete(root) },
    ...(up && { up }),
  };
}

/** Bytes of a tile in a message to the page. */
const TILE_BYTES = 220;

/**
 * Bounds the message with the tiles of a tileset by the size of its file. Tiles have 100 bytes or more if they have a
 * volume and a content.
 */
function requireWeight({ tiles }: TreeLoad, { length }: Uint8Array, where: string): void {
  const max = Math.floor((1e6 + 2 * length) / TILE_BYTES);
  if (tiles > max) refuse(where, `at most ${grouped(max)} tiles in ${grouped(length)} bytes`, grouped(tiles));
}

/** Whether a tile and all tiles below it are listed, and no content looks like a nested tileset. */
const isComplete = ({ implicit, contents, children }: Tile): boolean =>
  implicit === undefined && !contents.some(({ uri }) => /\.json(\?|$)/i.test(uri)) && children.every(isComplete);

/**
 * Reads a tile, and the subtree of an implicit one. The root of a nested tileset takes the place of the tile that refers
 * to it.
 */
async function read(tile: Tile, files: TreeFiles): Promise<ReadNode> {
  const { name, budget } = files;
  const load: TreeLoad = { tiles: 0, height: 0 };
  const openSubtree = (uri: string): Promise<Uint8Array> => openPart({ ...files, openFile: files.openIndex }, uri);
  const subtrees: SubtreeFiles = { name, budget, openSubtree, subtrees: new Map() };
  const completed = async (one: Tile): Promise<Tile> =>
    one.implicit ? readImplicit(one.implicit, load, subtrees) : one;
  const own = await completed(tile);
  let { isAdded, error } = own;
  const found: Tile[] = tile.implicit ? [...own.children] : [];
  const clouds: GaussianCloud[] = [];
  let others = 0;
  const left = own.contents.map((content) => ({ ...content, depth: 0 }));
  for (let content = left.shift(); content; content = left.shift()) {
    const { uri, toTileset, depth } = content;
    if (uri.length > MAX_PATH)
      throw damaged(name, `addresses of at most ${grouped(MAX_PATH)} characters`, 'longer ones', 'decode/header');
    const bytes = await openPart(files, uri);
    files.signal?.throwIfAborted();
    if (!isTileset(bytes)) {
      const cloud = await readContent({ ...files, bytes }, content, bytes);
      if (cloud) clouds.push(cloud);
      else others++;
      continue;
    }
    const where = `${name}, ${uri}`;
    if (depth >= MAX_NESTED)
      throw damaged(where, `tilesets at most ${MAX_NESTED} deep`, 'deeper ones', 'decode/header');
    const inner = await completed(parseTileset({ bytes, name: where, budget }, load, folderOf(uri), toTileset));
    requireWeight(load, bytes, where);
    ({ isAdded, error } = inner);
    for (const child of inner.children) found.push(child);
    left.push(...inner.contents.map((one) => ({ ...one, depth: depth + 1 })));
  }
  const parts = clouds.map((cloud) => ({ cloud, first: 0, count: cloud.count }));
  const cloud = parts.length > 1 ? mergeClouds(parts, files) : clouds.at(0);
  if (cloud && others > 0) warn(cloud, `${grouped(others)} contents of a tile without splats are left out.`);
  return { cloud, found, isAdded, error };
}

export const reader: TreeReader = { open, read: (node, _, files) => read(node as Tile, files) };
