import type { Credits } from '@gaussian-splat/core';
import { creditsOfAsset } from '../credits.js';
import { damaged } from '../faults.js';
import { grouped } from '../bytes.js';
import { failIn, isObject, parseJson, show, type FailAt, type JsonSource } from '../json.js';

/** Range of splats in a file: `offset` to `offset + count`, excluding the latter. */
export interface LodRun {
  /** Index of the file in {@link LodMeta.files}. */
  readonly file: number;
  readonly offset: number;
  readonly count: number;
}

/** A box of the scene with its splats at one or more levels of detail. `min` and `max` are corners (x, y, z). */
export interface LodLeaf {
  readonly min: readonly number[];
  readonly max: readonly number[];
  /** Range of splats of each level; undefined if the box lacks a level. Level 0 is the finest. */
  readonly levels: readonly (LodRun | undefined)[];
}

/** Index of a streamed scene. */
export interface LodMeta {
  /** Number of levels of detail. */
  readonly levels: number;
  /** Path of each SOG file, relative to the index: the `meta.json` of a folder, or a bundle. */
  readonly files: readonly string[];
  /** Path of the SOG file whose splats are shown at every level, or undefined. */
  readonly environment: string | undefined;
  readonly credits: Credits | undefined;
  readonly leaves: readonly LodLeaf[];
}

/** Maximum size of an index in bytes. An index has about 100 bytes for each leaf and level. */
export const MAX_INDEX_BYTES = 1 << 26;
/** Maximum length of a path in characters, because servers reject longer addresses. */
export const MAX_PATH = 2048;
const MAX_LEVELS = 64;

/**
 * Parses `lod-meta.json` of version 1, and of the earlier format without a version, whose `environment` may be null. Both
 * formats have `lodLevels`, `filenames` and `tree`.
 * @throws GaussianSplatError `decode/header`, `decode/unsupported` for other versions, or as `parseJson` does
 */
export function parseLodMeta(source: JsonSource): LodMeta {
  const { name } = source;
  const json = parseJson(source, MAX_INDEX_BYTES);
  const fail: FailAt = failIn(name);
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
    credits: creditsOfAsset(json.asset),
    leaves,
  };
}

type Fail = (path: string, expected: string, found: unknown) => never;

function isCount(value: unknown): value is number {
  return Number.isSafeInteger(value) && (value as number) >= 0;
}

/**
 * Returns the leaves of the tree in depth-first order. Neither recursion nor arguments depend on the size of the tree,
 * because a file may have any depth and breadth.
 */
function collectLeaves(root: unknown, levels: number, files: number, fail: Fail): LodLeaf[] {
  const leaves: LodLeaf[] = [];
  const open: unknown[] = [root];
  while (open.length > 0) {
    const node = open.pop();
    if (!isObject(node)) return fail('tree', 'an object for each box', node);
    // Children are pushed in reverse order, so that the first child is visited next.
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

/** A range of splats with the index of its leaf, `node`, and its level of detail. */
export interface NodeRun extends LodRun {
  readonly node: number;
  readonly level: number;
}

/** Returns the ranges of all leaves at every level, without empty ones. */
export function runsAtAllLevels({ leaves }: LodMeta): NodeRun[] {
  return leaves.flatMap(({ levels }, node) =>
    levels.flatMap((run, level) => (run === undefined || run.count === 0 ? [] : [{ ...run, node, level }])),
  );
}

/**
 * Returns one range of each leaf, without empty ones, for a level of detail. If a leaf lacks the level, the next finer
 * one applies, or else the next coarser one. The result has level 0.
 */
export function runsAtLevel({ leaves }: LodMeta, level: number): NodeRun[] {
  return leaves.flatMap(({ levels }, node) => {
    const finer = levels.slice(0, level + 1).findLast((run) => run !== undefined);
    const run = finer ?? levels.slice(level + 1).find((candidate) => candidate !== undefined);
    return run === undefined || run.count === 0 ? [] : [{ ...run, node, level: 0 }];
  });
}
