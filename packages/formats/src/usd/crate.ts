import { asciiOf, grouped } from '../bytes.js';
import { damaged } from '../faults.js';
import type { JsonSource } from '../json.js';
import { CrateBytes } from './crate-bytes.js';
import { CrateValues, type ValueRep } from './crate-values.js';
import {
  ARCS,
  ATTRIBUTE_BYTES,
  DATA_PREFIX,
  KEPT_METADATA,
  LAYER_DATA,
  MAX_DEPTH,
  PRIM_BYTES,
  type UsdLayer,
  type UsdPrim,
  type UsdValue,
} from './layer.js';
import { unpack } from './packed.js';

const [HEADER_BYTES, SECTION_BYTES, MAX_SECTIONS] = [24, 32, 64];
/** First version with compressed sections, of 2016. Values are 100 · minor + patch. */
const MIN_VERSION = 400;
/** Kinds of specs. */
const [ATTRIBUTE, PRIM, ROOT] = [1, 6, 7];
/** Bytes of a token beside its text. */
const TOKEN_BYTES = 16;

/** A path: the path that it belongs to, and its last name. */
interface CratePath {
  readonly parent: CratePath | undefined;
  readonly name: string;
  readonly isProperty: boolean;
  readonly depth: number;
  prim?: UsdPrim;
}

type Fields = ReadonlyMap<string, ValueRep>;

/**
 * Reads a binary layer (`.usdc`): all prims outside of variants, and their attributes, whose values are read late.
 * @throws GaussianSplatError `decode/truncated`, `decode/corrupt`, `decode/unsupported`, `out-of-memory/budget`
 */
export function readCrate(source: JsonSource): UsdLayer {
  const file = new CrateBytes(source);
  file.need(0, HEADER_BYTES);
  const version = 100 * source.bytes[9] + source.bytes[10];
  if (source.bytes[8] !== 0 || version < MIN_VERSION)
    throw damaged(
      file.name,
      'a binary layer of version 0.4 or later',
      source.bytes.subarray(8, 11).join('.'),
      'decode/unsupported',
    );
  const sections = sectionsOf(file);
  const section = (name: string): number => sections.get(name) ?? file.fault(HEADER_BYTES, `a section ${name}`, 'none');
  const tokens = readTokens(file, section('TOKENS'));
  const fields = readFields(file, section('FIELDS'), section('FIELDSETS'), tokens);
  const paths = readPaths(file, section('PATHS'), tokens);
  const values = new CrateValues(file, tokens, version, sections.get('STRINGS'));
  return layerOf(file, readSpecs(file, section('SPECS')), paths, fields, values);
}

function sectionsOf(file: CrateBytes): Map<string, number> {
  const start = file.u64(16);
  const count = file.u64(start);
  if (count > MAX_SECTIONS) file.fault(start, `at most ${MAX_SECTIONS} sections`, grouped(count));
  file.need(start + 8, SECTION_BYTES * count);
  return new Map(
    Array.from({ length: count }, (_, k) => {
      const at = start + 8 + SECTION_BYTES * k;
      return [asciiOf(file.bytes, at, at + 16).replace(/\0.*/s, ''), file.u64(at + 16)];
    }),
  );
}

function readTokens(file: CrateBytes, at: number): string[] {
  const [count, size] = [file.u64(at), file.u64(at + 8)];
  const { packed } = file.packed(at + 16);
  const bytes = unpack(packed, size);
  file.take(size + TOKEN_BYTES * count);
  if (count > bytes.length) file.fault(at, `${grouped(count)} tokens`, 'fewer');
  return new TextDecoder().decode(bytes).split('\0', count);
}

/** Returns a function for the fields of a set, by the index of its first field. */
function readFields(file: CrateBytes, at: number, setsAt: number, tokens: readonly string[]): (set: number) => Fields {
  const count = file.u64(at);
  const { integers: names, end } = file.integers(at + 8, count);
  const { packed } = file.packed(end);
  const reps = new DataView(unpack(packed, 8 * count).slice().buffer);
  const { integers: sets } = file.integers(setsAt + 8, file.u64(setsAt));
  return (set) => {
    const found = new Map<string, ValueRep>();
    for (let k = set; k >= 0 && k < sets.length && sets[k] !== -1; k++) {
      file.take(ATTRIBUTE_BYTES / 4);
      const field = sets[k];
      if (field < 0 || 8 * field + 8 > reps.byteLength) file.fault(setsAt, `${grouped(count)} fields`, String(field));
      const rep = { low: reps.getUint32(8 * field, true), high: reps.getUint32(8 * field + 4, true) };
      found.set(tokens[names[field]] ?? '', rep);
    }
    return found;
  };
}

/**
 * Returns the paths by index, each after its parent in the order of the tree. The tree is stored in depth-first order: a
 * jump of 0 means a sibling alone, -1 a child alone, -2 neither, and above 0 both, with the distance of the sibling.
 */
function readPaths(file: CrateBytes, at: number, tokens: readonly string[]): ReadonlyMap<number, CratePath> {
  const count = file.u64(at + 8);
  const indices = file.integers(at + 16, count);
  const names = file.integers(indices.end, count);
  const jumps = file.integers(names.end, count);
  file.take(2 * TOKEN_BYTES * count);
  const paths = new Map<number, CratePath>();
  const open: { i: number; parent: CratePath | undefined }[] = count > 0 ? [{ i: 0, parent: undefined }] : [];
  for (let visits = 0, next = open.pop(); next; next = open.pop()) {
    const { i, parent } = next;
    const depth = parent ? parent.depth + 1 : 0;
    if (i >= count || visits++ > count) file.fault(at, 'a tree of paths', 'one that does not end');
    if (depth > MAX_DEPTH) file.fault(at, `paths at most ${MAX_DEPTH} deep`, 'deeper ones');
    const name = tokens[Math.abs(names.integers[i])] ?? file.fault(at, 'the name of a path', 'none');
    const path = { parent, name: parent ? name : '', isProperty: names.integers[i] < 0, depth };
    paths.set(indices.integers[i], path);
    const jump = jumps.integers[i];
    if (jump >= 0) open.push({ i: jump > 0 ? i + jump : i + 1, parent });
    if (jump > 0 || jump === -1) open.push({ i: i + 1, parent: path });
  }
  return paths;
}

/** Index of the path, of the first field, and kind of each spec. */
interface Specs {
  readonly paths: Int32Array;
  readonly sets: Int32Array;
  readonly kinds: Int32Array;
}

function readSpecs(file: CrateBytes, at: number): Specs {
  const count = file.u64(at);
  const paths = file.integers(at + 8, count);
  const sets = file.integers(paths.end, count);
  const kinds = file.integers(sets.end, count);
  return { paths: paths.integers, sets: sets.integers, kinds: kinds.integers };
}

function layerOf(
  file: CrateBytes,
  specs: Specs,
  paths: ReadonlyMap<number, CratePath>,
  fieldsAt: (set: number) => Fields,
  values: CrateValues,
): UsdLayer {
  const sets = new Map<CratePath, number>();
  const attributes: [path: CratePath, set: number][] = [];
  const metadata = new Map<string, UsdValue>();
  let arc: string | undefined;
  file.take(TOKEN_BYTES * specs.kinds.length);
  specs.kinds.forEach((kind, k) => {
    const path = paths.get(specs.paths[k]);
    if (!path) return file.fault(0, 'a path for each spec', `${specs.paths[k]}`);
    if (kind === ROOT) arc ??= readMetadata(fieldsAt(specs.sets[k]), values, metadata);
    else if (kind === PRIM) sets.set(path, specs.sets[k]);
    else if (kind === ATTRIBUTE) attributes.push([path, specs.sets[k]]);
  });
  const prims: UsdPrim[] = [];
  // Paths are in the order of the tree, so that parents precede their children. Paths in variants have no parent.
  for (const path of paths.values()) {
    const set = sets.get(path);
    const parent = path.parent?.prim;
    if (set === undefined || (path.parent?.parent !== undefined && !parent)) continue;
    file.take(PRIM_BYTES);
    path.prim = primOf(path.name, parent, fieldsAt(set), values);
    prims.push(path.prim);
  }
  for (const [{ parent, name }, set] of attributes) {
    if (!parent?.prim) continue;
    file.take(ATTRIBUTE_BYTES);
    const found = fieldsAt(set);
    const [value, samples] = [found.get('default'), found.get('timeSamples')];
    parent.prim.attributes.set(name, {
      value: value && values.late(value),
      samples: samples && values.samples(samples),
    });
  }
  return { prims, metadata, arc };
}

function primOf(name: string, parent: UsdPrim | undefined, fields: Fields, values: CrateValues): UsdPrim {
  const textOf = (field: string): string => {
    const rep = fields.get(field);
    const value = rep && values.read(rep);
    return typeof value === 'string' ? value : '';
  };
  const metadata = new Map<string, UsdValue>();
  const arc = readMetadata(fields, values, metadata);
  const specifier = (textOf('specifier') || 'over') as UsdPrim['specifier'];
  return { name, type: textOf('typeName'), specifier, parent, attributes: new Map(), metadata, arc };
}

/** Reads the metadata that are kept, and returns a composition arc if there is one. */
function readMetadata(fields: Fields, values: CrateValues, to: Map<string, UsdValue>): string | undefined {
  let arc: string | undefined;
  for (const [name, rep] of fields) {
    const value = KEPT_METADATA.has(name) ? values.read(rep) : undefined;
    if (value !== undefined) to.set(name, value);
    if (name === LAYER_DATA) for (const [key, text] of values.dictionary(rep)) to.set(DATA_PREFIX + key, text);
    if (ARCS.has(name) && values.hasItems(rep)) arc ??= ARCS.get(name);
  }
  return arc;
}
