import { GaussianSplatError, type GaussianCloud, type Vector3 } from '@gaussian-splat/core';
import { checkedPart } from '../foreign-signatures.js';
import { grouped } from '../bytes.js';
import { damaged, warn } from '../faults.js';
import { multiply, type Affine } from '../gltf/nodes.js';
import { mergeClouds } from '../merge-clouds.js';
import type { SceneSource } from '../scene-format.js';
import { contentsAt, type TileContent } from '../tileset.js';
import { applyMotion } from '../transform/moved-cloud.js';
import { isTileset, readGltf } from './gltf.js';
import { noParts } from './sog.js';

/**
 * Converts between the coordinates of a cloud (x right, y down, z forward) and of tiles (z up), via those of glTF (y
 * up).
 */
const TO_CLOUD: Affine = [-1, 0, 0, 0, 0, 0, -1, 0, 0, -1, 0, 0];
/** Maximum nesting of tilesets. */
const MAX_NESTED = 16;
/** A tileset farther than this from the Earth's center, in meters, is georeferenced. */
const ON_EARTH = 1e6;

/**
 * Reads a tileset of 3D Tiles whose tiles are glTF with splats, at one level of detail (`source.level`, 0 is the
 * finest). Georeferenced tilesets get the direction away from the Earth's center as `hints.up`. Tiles of other kinds
 * are skipped with a warning.
 */
export async function readTiles(source: SceneSource): Promise<GaussianCloud> {
  const level = source.level === 'all' ? 0 : (source.level ?? 0);
  const clouds: GaussianCloud[] = [];
  let others = 0;
  for await (const { toTileset, uri, bytes } of filesOf(source, level)) {
    source.signal?.throwIfAborted();
    const { budget, signal } = source;
    const name = `${source.name}, ${uri}`;
    const folder = folderOf(uri);
    const openFile = (path: string, query?: string): Promise<Uint8Array> => opened(source, folder + path, query);
    const cloud = await readGltf({ bytes, name, budget, signal, openFile }).catch((error: unknown) => {
      if (error instanceof GaussianSplatError && error.code === 'decode/not-splats') return undefined;
      throw error;
    });
    // Both rotations are their own inverse.
    if (cloud) clouds.push(applyMotion(cloud, multiply(TO_CLOUD, multiply(toTileset, TO_CLOUD))));
    else others++;
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

type TileFile = TileContent & { readonly bytes: Uint8Array };

/** Iterates over the glTF files of a tileset and of nested tilesets. */
async function* filesOf(source: SceneSource, level: number): AsyncGenerator<TileFile> {
  const { name, budget } = source;
  const left: (TileContent & { readonly depth: number })[] = [];
  /** Remaining references to each file, and the files that have some. */
  const uses = new Map<string, number>();
  const kept = new Map<string, Uint8Array>();
  const list = (contents: readonly TileContent[], depth: number): void => {
    for (const content of [...contents].reverse()) {
      left.push({ ...content, depth });
      uses.set(content.uri, (uses.get(content.uri) ?? 0) + 1);
    }
  };
  const load = { tiles: 0 };
  list(contentsAt(source, level, load), 0);
  for (let content = left.pop(); content; content = left.pop()) {
    const { uri, toTileset, depth } = content;
    const [path, query = ''] = uri.split(/(?=\?)/, 2);
    const where = `${name}, ${uri}`;
    // A repeated file is fetched once, and charged each time.
    const again = kept.get(uri);
    budget.take(again?.length ?? 0, where);
    const bytes = again ?? (await checkedPart(await opened(source, decoded(path), query), where));
    uses.set(uri, uses.get(uri)! - 1);
    if (uses.get(uri)) kept.set(uri, bytes);
    else kept.delete(uri);
    if (!isTileset(bytes)) {
      yield { uri, toTileset, bytes };
      continue;
    }
    if (depth >= MAX_NESTED)
      throw damaged(where, `tilesets at most ${MAX_NESTED} deep`, 'deeper ones', 'decode/header');
    const inner = contentsAt({ bytes, name: where, budget }, level, load, toTileset);
    list(
      inner.map((one) => ({ ...one, uri: folderOf(path) + one.uri })),
      depth + 1,
    );
  }
}

const opened = ({ openFile, name }: SceneSource, path: string, query?: string): Promise<Uint8Array> =>
  (openFile ?? noParts(name, 'scene.zip'))(path, query);

const folderOf = (uri: string): string => uri.replace(/\?.*$/, '').replace(/[^/]*$/, '');

function decoded(path: string): string {
  try {
    return decodeURIComponent(path);
  } catch {
    return path;
  }
}

/** Direction away from the Earth's center, for a cloud at its surface. */
function upAt(origin: Vector3): Vector3 | undefined {
  const radius = Math.hypot(...origin);
  return radius < ON_EARTH ? undefined : (origin.map((x) => x / radius) as unknown as Vector3);
}
