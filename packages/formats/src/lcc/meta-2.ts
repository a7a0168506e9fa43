/** The description of LCC2, version 0.0.3 of https://github.com/xgrids/LCC2Whitepaper and the form before it. */
import { damaged } from '../faults.js';
import { failIn, isObject, parseJson, show, type FailAt, type Json, type JsonSource, type ParseJson } from '../json.js';
import { MAX_INDEX_BYTES, MAX_PATH } from '../lod/meta.js';
import type { SceneNode, Volume } from '../tree/types.js';

const MAX_LEVELS = 64;

/** A region at a level. Its volume is its `boundingBox`; its children are the next finer level. */
export interface Lcc2Node extends SceneNode {
  /** Path of the SOG bundle with the node's splats; absent for a node without any. */
  readonly file?: string | undefined;
  /** Range of the node's splats in the bundle; absent for all of them. */
  readonly run?: { readonly first: number; readonly count: number } | undefined;
  readonly children: readonly Lcc2Node[];
}

export interface Lcc2Meta {
  /** Nodes of the coarsest level. */
  readonly roots: readonly Lcc2Node[];
  readonly levels: number;
  /** Number of splats of each level, the finest first, if the description has it. */
  readonly counts: readonly unknown[];
  /** Path of the bundle with the splats around the scene. */
  readonly environment: string | undefined;
}

/**
 * Parses a description. Its earlier form has other names, and paths without `.sog`.
 * @throws GaussianSplatError `decode/header`, `decode/unsupported` for parts that are not SOG, or as `parseJson` does
 */
export function parseLcc2Meta(source: JsonSource): Lcc2Meta {
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
  const levels = totalLevels as number;
  const fileOf = ({ name }: Json, path: string): string =>
    files[name as number] ?? fail(`${path}.name`, `a number below ${files.length}`, name);
  const around = isObject(root.data) ? root.data.env : undefined;
  const environment = isObject(around) ? fileOf(around, 'root.data.env') : undefined;
  const splatsOf = (data: Json): Pick<Lcc2Node, 'file' | 'run'> => {
    const own = data['3dgs'];
    const where = 'root.child, data.3dgs';
    const file = isObject(own) ? fileOf(own, where) : undefined;
    if (!isObject(own) || file === environment) return {};
    const { start: first = 0, count } = own;
    if (count === undefined) return { file };
    if (!isCount(first) || !isCount(count)) return fail(where, 'start and count as whole numbers', own);
    return count > 0 ? { file, run: { first, count } } : {};
  };
  const nodesIn = ({ child }: Json, depth: number): Lcc2Node[] =>
    (depth < levels && (isObject(child) || Array.isArray(child)) ? Object.values(child) : [])
      .filter(isObject)
      .map((node) => ({
        ...(isObject(node.data) && splatsOf(node.data)),
        ...{ volume: volumeOf(node.boundingBox), children: nodesIn(node, depth + 1) },
      }));
  const counts = Array.isArray(lodSplats) ? lodSplats : Array.isArray(earlier) ? [...earlier].reverse() : [];
  return { roots: nodesIn(root, 0), levels, counts, environment };
}

const isCount = (value: unknown): value is number => Number.isSafeInteger(value) && (value as number) >= 0;

/** Returns a `boundingBox` as a volume; undefined for anything else. */
function volumeOf(box: unknown): Volume | undefined {
  const corners = isObject(box) ? [box.min, box.max] : [];
  const isBox = corners.length > 0 && corners.every((corner) => Array.isArray(corner) && corner.length === 3);
  const numbers = isBox ? (corners as number[][]).flat() : [];
  if (numbers.length === 0 || !numbers.every(Number.isFinite)) return undefined;
  const [x, y, z] = [0, 1, 2].map((axis) => Math.abs(numbers[3 + axis] - numbers[axis]) / 2);
  const center = [0, 1, 2].map((axis) => (numbers[axis] + numbers[3 + axis]) / 2);
  return [...center, x, 0, 0, 0, y, 0, 0, 0, z, Math.hypot(x, y, z)];
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
