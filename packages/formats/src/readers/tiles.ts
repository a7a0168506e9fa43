import { GaussianSplatError, type GaussianCloud, type Vector3 } from '@gaussian-splat/core';
import { checkedPart } from '../foreign-signatures.js';
import { asciiOf, grouped } from '../bytes.js';
import { damaged, warn } from '../faults.js';
import { multiply } from '../gltf/nodes.js';
import type { SubtreeFiles } from '../implicit-tiles.js';
import { MAX_PATH } from '../lod/meta.js';
import { mergeClouds } from '../merge-clouds.js';
import type { SceneSource } from '../scene-format.js';
import type { TileContent } from '../tile.js';
import { TO_CLOUD } from '../tile-volume.js';
import { contentsAt, parseTileset, type TreeLoad } from '../tileset.js';
import { applyMotion } from '../transform/moved-cloud.js';
import { isTileset, readGltf } from './gltf.js';
import { noParts } from './sog.js';

/** Maximum nesting of tilesets. */
export const MAX_NESTED = 16;
/** Bytes charged for each reference to a file, besides its address. */
const CONTENT_BYTES = 256;
/** Minimum distance from the Earth's center, in meters, of a georeferenced tileset. */
const ON_EARTH = 1e6;

/**
 * Reads a tileset of 3D Tiles whose tiles are glTF with splats, at the level of detail `source.level`; 0 is the finest.
 * If it has more than `source.maxSplats` splats, the finest coarser level with fewer is read, else the coarsest. A
 * tileset does not say how many splats its tiles have, so that each level is read until it has too many. In a
 * georeferenced tileset, `hints.up` is the direction away from the Earth's center. Tiles without splats are skipped with
 * a warning.
 */
export async function readTiles(source: SceneSource): Promise<GaussianCloud> {
  for (let level = source.level === 'all' ? 0 : (source.level ?? 0); ; level++) {
    const whole = await readLevel(source, level);
    if (whole) return whole;
  }
}

/** Reads a level; undefined if it has too many splats and is not the coarsest. */
async function readLevel(source: SceneSource, level: number): Promise<GaussianCloud | undefined> {
  const { maxSplats = Infinity } = source;
  const load: TreeLoad = { tiles: 0, height: 0 };
  const clouds: GaussianCloud[] = [];
  let others = 0;
  let count = 0;
  const hasCoarser = (): boolean => maxSplats < Infinity && level < load.height;
  for await (const { toTileset, turn, uri, bytes } of filesOf(source, level, load)) {
    source.signal?.throwIfAborted();
    const cloud = await readContent(source, { uri, toTileset, turn }, bytes).catch((error: unknown) => {
      if (error instanceof GaussianSplatError && error.code === 'out-of-memory/budget' && hasCoarser()) return null;
      throw error;
    });
    if (cloud === null) return undefined;
    if (cloud) clouds.push(cloud);
    else others++;
    count += cloud?.count ?? 0;
    if (count > maxSplats && hasCoarser()) return undefined;
  }
  if (clouds.length === 0)
    throw damaged(
      source.name,
      'tiles with splats (KHR_gaussian_splatting)',
      `a tileset of 3D Tiles with ${grouped(others)} tiles without`,
      'decode/unsupported',
    );
  const whole = mergeClouds(
    clouds.map((cloud) => ({ cloud, first: 0, count: cloud.count })),
    source,
  );
  const up = upAt(whole.origin);
  if (up) whole.hints = { ...whole.hints, up };
  if (others > 0) warn(whole, `${grouped(others)} tiles without splats are left out.`);
  return whole;
}

/**
 * Reads a content of a tile, in the coordinates of a cloud. Resolves to undefined if it has no splats.
 * @param bytes The file.
 * @throws GaussianSplatError as `readGltf` does
 */
export async function readContent(
  source: SceneSource,
  { uri, toTileset, turn }: TileContent,
  bytes: Uint8Array,
): Promise<GaussianCloud | undefined> {
  if (isOtherTile(bytes)) return undefined;
  const { budget, signal } = source;
  const folder = decoded(folderOf(uri));
  const openFile = (path: string, query?: string): Promise<Uint8Array> => opened(source, folder + path, query);
  const name = `${source.name}, ${uri}`;
  const cloud = await readGltf({ bytes, name, budget, signal, openFile }).catch((error: unknown) => {
    if (error instanceof GaussianSplatError && error.code === 'decode/not-splats') return undefined;
    throw error;
  });
  // TO_CLOUD is its own inverse, so that the same transform leads from the cloud to the tile.
  const fromContent = turn ? multiply(toTileset, turn) : toTileset;
  return cloud && applyMotion(cloud, multiply(TO_CLOUD, multiply(fromContent, TO_CLOUD)));
}

/** Opens a file of a tileset. @param uri URI from the outermost tileset, with its query. */
export async function openPart(source: Pick<SceneSource, 'openFile' | 'name'>, uri: string): Promise<Uint8Array> {
  const [path, query = ''] = uri.split(/(?=\?)/, 2);
  return checkedPart(await opened(source, decoded(path), query), `${source.name}, ${uri}`);
}

type TileFile = TileContent & { readonly bytes: Uint8Array };

/** Iterates over the glTF files of a tileset and of nested tilesets, at a level of detail. */
async function* filesOf(source: SceneSource, level: number, load: TreeLoad): AsyncGenerator<TileFile> {
  const { name, budget } = source;
  const left: (TileContent & { readonly depth: number })[] = [];
  /** Number of remaining references to each file. */
  const uses = new Map<string, number>();
  const kept = new Map<string, Uint8Array>();
  const list = (contents: readonly TileContent[], depth: number): void => {
    for (const content of [...contents].reverse()) {
      // The folder of a nested tileset is part of the address of each of its contents.
      if (content.uri.length > MAX_PATH)
        throw damaged(name, `addresses of at most ${grouped(MAX_PATH)} characters`, 'longer ones', 'decode/header');
      budget.take(CONTENT_BYTES + 2 * content.uri.length, name);
      left.push({ ...content, depth });
      uses.set(content.uri, (uses.get(content.uri) ?? 0) + 1);
    }
  };
  const openSubtree = (uri: string): Promise<Uint8Array> => openPart(source, uri);
  const files: SubtreeFiles = { name, budget, openSubtree, subtrees: new Map() };
  list(await contentsAt(parseTileset(source, load), level, load, files), 0);
  for (let content = left.pop(); content; content = left.pop()) {
    const { uri, toTileset, turn, depth } = content;
    const where = `${name}, ${uri}`;
    // A file with several references is fetched once, and charged for each further reference.
    const again = kept.get(uri);
    budget.take(again?.length ?? 0, where);
    const bytes = again ?? (await openPart(source, uri));
    uses.set(uri, uses.get(uri)! - 1);
    if (uses.get(uri)) kept.set(uri, bytes);
    else kept.delete(uri);
    if (!isTileset(bytes)) {
      yield { uri, toTileset, turn, bytes };
      continue;
    }
    if (depth >= MAX_NESTED)
      throw damaged(where, `tilesets at most ${MAX_NESTED} deep`, 'deeper ones', 'decode/header');
    const inner = parseTileset({ bytes, name: where, budget }, load, folderOf(uri), toTileset);
    list(await contentsAt(inner, level, load, { ...files, name: where }), depth + 1);
  }
}

const opened = (
  { openFile, name }: Pick<SceneSource, 'openFile' | 'name'>,
  path: string,
  query?: string,
): Promise<Uint8Array> => (openFile ?? noParts(name, 'scene.zip'))(path, query);

/** Whether a tile is of a kind of 3D Tiles 1.0, which cannot have splats. */
const isOtherTile = (bytes: Uint8Array): boolean => /^(b3dm|i3dm|pnts|cmpt)$/.test(asciiOf(bytes, 0, 4));

export function folderOf(uri: string): string {
  const [path] = uri.split('?', 1);
  return path.slice(0, path.lastIndexOf('/') + 1);
}

function decoded(path: string): string {
  try {
    return decodeURIComponent(path);
  } catch {
    return path;
  }
}

/** Returns the unit direction away from the Earth's center for a georeferenced origin; otherwise undefined. */
export function upAt(origin: Vector3): Vector3 | undefined {
  const radius = Math.hypot(...origin);
  return radius < ON_EARTH ? undefined : (origin.map((x) => x / radius) as unknown as Vector3);
}
