import type { GaussianCloud } from '@gaussian-splat/core';
import { checkedPart } from '../foreign-signatures.js';
import { damaged, warn } from '../faults.js';
import { failIn, isObject, parseJson, show, type FailAt, type Json, type JsonSource, type ParseJson } from '../json.js';
import { MAX_INDEX_BYTES, MAX_PATH } from '../lod/meta.js';
import { mergeClouds } from '../merge-clouds.js';
import type { SceneSource } from '../scene-format.js';
import { optionalPart } from './optional-part.js';
import { readSogPart } from '../sog/read-sog.js';
import { noParts } from './sog.js';

const MAX_LEVELS = 64;

/** Description of an LCC2 scene: the content of its `.lcc2` file. */
interface Lcc2Meta {
  /** Paths of the SOG bundles. */
  readonly files: readonly string[];
  /** For each level, the finest first, the indices of its files in ascending order. */
  readonly levels: readonly (readonly number[])[];
  /** Number of splats of each level, if the description has it. */
  readonly counts: readonly unknown[];
  /** Index of the file with the splats around the scene. */
  readonly environment: number | undefined;
}

/**
 * Reads LCC2 of XGRIDS: a description (`.lcc2`) of an octree, whose nodes have SOG bundles. The level of detail is
 * `source.level`; 0 is the finest. The splats of the environment are added at every level, if their file exists. The z
 * axis points up, which becomes `hints.up`.
 */
export async function readLcc2(source: SceneSource): Promise<GaussianCloud> {
  const { name, level = 0, maxSplats = Infinity, budget, signal } = source;
  const { files, levels, counts, environment } = parseLcc2Meta(source);
  let own = Math.min(level === 'all' ? 0 : level, levels.length - 1);
  while (own < levels.length - 1 && Number(counts[own]) > maxSplats) own++;
  const open = source.openFile ?? noParts(name, 'scene.zip');
  const clouds: GaussianCloud[] = [];
  let leftOut: string | undefined;
  for (const file of [...levels[own], ...(environment === undefined ? [] : [environment])]) {
    signal?.throwIfAborted();
    const path = files[file];
    const where = `${name}, ${path}`;
    const asked = open(path).then((found) => checkedPart(found, where));
    const bytes = await (file === environment ? optionalPart(asked, signal) : asked);
    if (bytes instanceof Error) {
      leftOut = `The surroundings (${path}) are left out: ${bytes.message}`;
      continue;
    }
    const folder = path.slice(0, path.lastIndexOf('/') + 1);
    clouds.push(await readSogPart({ bytes, name: where, budget, signal }, (part) => open(folder + part)));
  }
  const whole = mergeClouds(
    clouds.map((cloud) => ({ cloud, first: 0, count: cloud.count })),
    source,
  );
  if (leftOut !== undefined) warn(whole, leftOut);
  whole.hints = { ...whole.hints, up: [0, 0, 1] };
  return whole;
}

/** Parses a description. Its earlier form has other names, and paths without `.sog`. */
function parseLcc2Meta(source: JsonSource): Lcc2Meta {
  const json = parseJson(source, MAX_INDEX_BYTES, parseWithTrailingCommas);
  const fail: FailAt = failIn(source.name);
  const { root, totalLevels = json.lod_level, lodSplats, lod_3dgs_info: earlier, splatType = '.sog' } = json;
  if (splatType !== '.sog')
    throw damaged(`${source.name}, splatType`, 'parts that are SOG', show(splatType), 'decode/unsupported');
  if (!Number.isInteger(totalLevels) || (totalLevels as number) < 1 || (totalLevels as number) > MAX_LEVELS)
    fail('totalLevels', `1 to ${MAX_LEVELS}`, totalLevels);
  if (!isObject(root)) return fail('root', 'an object', root);
  const files = pathsOf(root);
  if (!files?.every((file) => file !== '' && file.length <= MAX_PATH))
    return fail('root.splatFiles', 'paths of SOG bundles', root.splatFiles ?? root.files);
  const fileOf = (data: unknown, path: string): number | undefined => {
    if (!isObject(data)) return undefined;
    const { name } = data;
    return Number.isInteger(name) && files[name as number] !== undefined
      ? (name as number)
      : fail(path, `a number below ${files.length}`, name);
  };
  const environment = fileOf(isObject(root.data) ? root.data.env : undefined, 'root.data.env.name');
  const found = Array.from({ length: totalLevels as number }, () => new Set<number>());
  // A stack instead of recursion, because a file may have any depth.
  const open: (readonly [node: Json, depth: number])[] = [[root, 0]];
  for (let top = open.pop(); top; top = open.pop()) {
    const [node, depth] = top;
    const own = depth > 0 && isObject(node.data) ? fileOf(node.data['3dgs'], 'root.child, data.3dgs.name') : undefined;
    if (own !== undefined && own !== environment) found[found.length - depth]?.add(own);
    if (depth === found.length) continue;
    for (const child of Object.values(isObject(node.child) || Array.isArray(node.child) ? node.child : {}))
      if (isObject(child)) open.push([child, depth + 1]);
  }
  const levels = found.map((own) => [...own].sort((a, b) => a - b));
  if (levels[0].length === 0) fail('root.child', 'files of the finest level', 'none');
  const counts = Array.isArray(lodSplats) ? lodSplats : Array.isArray(earlier) ? [...earlier].reverse() : [];
  return { files, levels: levels.filter((own) => own.length > 0), counts, environment };
}

/** Parses JSON that may have commas before closing brackets, which some exporters of LCC2 write. */
const parseWithTrailingCommas: ParseJson = (text, reviver) => {
  try {
    return JSON.parse(text, reviver);
  } catch (error) {
    // Strings are matched as a whole, with an optional end, so that the time is linear.
    const plain = text.replace(/("(?:[^"\\]|\\.)*"?)|,(?=\s*[}\]])/gs, (_, string: string | undefined) => string ?? '');
    if (plain === text) throw error;
    return JSON.parse(plain, reviver);
  }
};

/** Returns the paths of the bundles; undefined if they are no list of texts. */
function pathsOf({ splatFiles, files }: Json): string[] | undefined {
  const own = splatFiles ?? files;
  if (!Array.isArray(own) || !own.every((file) => typeof file === 'string')) return undefined;
  if (splatFiles !== undefined) return own as string[];
  return own.map((file: string) => file.replace(/^\//, '').replace(/(\.sog)?$/, '.sog'));
}
