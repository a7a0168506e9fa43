import { damaged } from '../faults.js';
import { grouped } from '../bytes.js';
import { isObject, parseJson, show, type JsonSource } from '../json.js';

/** Splats `offset` to `offset + count` of one file. */
export interface LodRun {
  /** Index into {@link LodMeta.files}. */
  readonly file: number;
  readonly offset: number;
  readonly count: number;
}

/** A box of space with its splats at one or more levels of detail. */
export interface LodLeaf {
  readonly min: readonly number[];
  readonly max: readonly number[];
  /** Sparse: a level may be missing. Index 0 is the finest. */
  readonly levels: readonly (LodRun | undefined)[];
}

/** The index of a streamed scene. */
export interface LodMeta {
  /** Number of levels. */
  readonly levels: number;
  /** Paths of the `meta.json` of each SOG, or of a bundle, relative to the index. */
  readonly files: readonly string[];
  /** Splats that every level shows, or undefined. */
  readonly environment: string | undefined;
  readonly leaves: readonly LodLeaf[];
}

/** An index takes about 100 bytes for each leaf and level. */
export const MAX_INDEX_BYTES = 1 << 26;
/** Maximum length of a path in characters, because servers reject longer addresses. */
const MAX_PATH = 2048;
const MAX_LEVELS = 64;

/**
 * Reads `lod-meta.json` in both its dialects: version 1 (`version`, `asset`, `count`, `counts`) and the earlier one
 * without a version (whose `environment` may be null). Both have `lodLevels`, `filenames` and `tree`.
 */
export function parseLodMeta(source: JsonSource): LodMeta {
  const { name } = source;
  const json = parseJson(source, MAX_INDEX_BYTES);
  const fail = (path: string, expected: string, found: unknown): never => {
    throw damaged(`${name}, ${path}`, expected, show(found), 'decode/header');
  };
  const { version = 1, lodLevels, filenames, environment, tree } = json;
  if (version !== 1) throw damaged(`${name}, version`, 'version 1', show(version), 'decode/unsupported');
  if (!isCount(lodLevels) || lodLevels < 1 || lodLevels > MAX_LEVELS)
    fail('lodLevels', `1 to ${MAX_LEVELS}`, lodLevels);
  if (!Array.isArray(filenames) || !filenames.every((file) => typeof file === 'string' && file !== '')) {
    return fail('filenames', 'paths of SOG descriptions', filenames);
  }
  const isLong = (path: unknown): boolean => typeof path === 'string' && path.length > MAX_PATH;
  if ([...filenames, environment].some(isLong))
    fail('filenames', `paths of at most ${grouped(MAX_PATH)} characters`, 'longer ones');
  if (environment !== undefined && environment !== null && typeof environment !== 'string') {
    fail('environment', 'a path or nothing', environment);
  }
  const leaves = collectLeaves(tree, lodLevels as number, filenames.length, fail);
  if (leaves.length === 0) fail('tree', 'boxes with splats', tree);
  return {
    levels: lodLevels as number,
    files: filenames,
    environment: (environment as string | null) || undefined,
    leaves,
  };
}

type Fail = (path: string, expected: string, found: unknown) => never;

function isCount(value: unknown): value is number {
  return Number.isSafeInteger(value) && (value as number) >= 0;
}

/**
 * Walks the tree without recursion and without spreading children as arguments, because the file chooses its depth and
 * breadth.
 */
function collectLeaves(root: unknown, levels: number, files: number, fail: Fail): LodLeaf[] {
  const leaves: LodLeaf[] = [];
  const open: unknown[] = [root];
  while (open.length > 0) {
    const node = open.pop();
    if (!isObject(node)) return fail('tree', 'an object for each box', node);
    // Children are pushed in reverse, so that the first is next.
    const children: unknown[] = Array.isArray(node.children) ? node.children : [];
    for (let k = children.length - 1; k >= 0; k--) open.push(children[k]);
    if (node.lods !== undefined) leaves.push(parseLeaf(node, levels, files, fail));
  }
  return leaves;
}

function parseLeaf(node: Record<string, unknown>, levels: number, files: number, fail: Fail): LodLeaf {
  const bound = isObject(node.bound) ? node.bound : fail('tree, bound', 'a box', node.bound);
  const corner = (key: string): number[] => {
    const value = bound[key];
    const isFine = Array.isArray(value) && value.length === 3 && value.every((n) => Number.isFinite(n));
    return isFine ? (value as number[]) : fail(`tree, bound.${key}`, '3 numbers', value);
  };
  const lods = isObject(node.lods) ? node.lods : fail('tree, lods', 'an object', node.lods);
  const runs: (LodRun | undefined)[] = new Array(levels).fill(undefined);
  for (const [key, value] of Object.entries(lods)) {
    const level = Number(key);
    if (!/^\d+$/.test(key) || level >= levels) fail('tree, lods', `levels 0 to ${levels - 1}`, key);
    runs[level] = parseRun(value, files, fail);
  }
  return { min: corner('min'), max: corner('max'), levels: runs };
}

function parseRun(value: unknown, files: number, fail: Fail): LodRun {
  if (!isObject(value)) return fail('tree, lods', 'file, offset and count', value);
  const { file, offset = 0, count } = value;
  if (!isCount(file) || file >= files) fail('tree, lods, file', `0 to ${grouped(files - 1)}`, file);
  if (!isCount(offset) || !isCount(count)) fail('tree, lods', 'offset and count as whole numbers', value);
  return { file: file as number, offset: offset as number, count: count as number };
}

/** A run with its node of the scene and its level. */
export interface NodeRun extends LodRun {
  readonly node: number;
  readonly level: number;
}

/** All runs of all boxes, at every level. */
export function runsAtAllLevels({ leaves }: LodMeta): NodeRun[] {
  return leaves.flatMap(({ levels }, node) =>
    levels.flatMap((run, level) => (run === undefined || run.count === 0 ? [] : [{ ...run, node, level }])),
  );
}

/** Runs of the scene at a level: of each box that level, or the nearest available one, preferring finer. */
export function runsAtLevel({ leaves }: LodMeta, level: number): NodeRun[] {
  return leaves.flatMap(({ levels }, node) => {
    const finer = levels.slice(0, level + 1).findLast((run) => run !== undefined);
    const run = finer ?? levels.slice(level + 1).find((candidate) => candidate !== undefined);
    return run === undefined || run.count === 0 ? [] : [{ ...run, node, level: 0 }];
  });
}
