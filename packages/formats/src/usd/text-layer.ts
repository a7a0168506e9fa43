import type { JsonSource } from '../json.js';
import { grouped } from '../bytes.js';
import { damaged } from '../faults.js';
import {
  ARCS,
  ATTRIBUTE_BYTES,
  DATA_PREFIX,
  KEPT_METADATA,
  LAYER_DATA,
  MAX_DEPTH,
  PRIM_BYTES,
  type LateValue,
  type UsdAttribute,
  type UsdLayer,
  type UsdPrim,
  type UsdValue,
} from './layer.js';
import { Scanner, type Precision } from './scanner.js';

/** Maximum size of a layer of text. Browsers do not support much longer strings. */
const MAX_TEXT_BYTES = 500_000_000;
/** Operations on lists, which precede the names of metadata and relationships. */
const LIST_OPERATIONS = /^(add|append|prepend|delete|reorder)$/;
const QUALIFIERS = /^(custom|uniform|varying|config)$/;

/** Draft of a prim or a layer whose metadata are read. */
interface WithMetadata {
  readonly metadata: Map<string, UsdValue>;
  arc?: string | undefined;
}

/**
 * Reads a layer of text (`.usda`): all prims outside of variants, and their attributes, whose values are parsed late.
 * @throws GaussianSplatError `decode/truncated`, `decode/corrupt`, `decode/unsupported`, `out-of-memory/budget`
 */
export function readTextLayer({ bytes, name, budget }: JsonSource): UsdLayer {
  if (bytes.length > MAX_TEXT_BYTES) {
    const expected = `text of at most ${grouped(MAX_TEXT_BYTES)} bytes`;
    throw damaged(name, expected, grouped(bytes.length), 'decode/unsupported');
  }
  budget.take(2 * bytes.length, name);
  const scanner = new Scanner(new TextDecoder().decode(bytes), name, budget);
  const layer: WithMetadata = { metadata: new Map() };
  const prims: UsdPrim[] = [];
  readMetadata(scanner, layer);
  const open: UsdPrim[] = [];
  for (let word = scanner.next(); word !== '' || open.length > 0; word = scanner.next()) {
    const prim = open.at(-1);
    if (word === '') scanner.fault('"}"', '');
    else if (word === '}') {
      if (!open.pop()) scanner.fault('a prim', word);
    } else if (word === 'def' || word === 'over' || word === 'class') {
      if (open.length >= MAX_DEPTH) scanner.fault(`prims at most ${MAX_DEPTH} deep`, 'deeper ones');
      const child = openPrim(scanner, word, prim);
      prims.push(child);
      open.push(child);
    } else if (word === 'reorder') skipReorder(scanner);
    else if (!prim) scanner.fault('a prim', word);
    else if (word === 'variantSet') skipVariants(scanner, prim);
    else readProperty(scanner, word, prim);
  }
  return { prims, ...layer };
}

function openPrim(scanner: Scanner, specifier: UsdPrim['specifier'], parent: UsdPrim | undefined): UsdPrim {
  scanner.take(PRIM_BYTES);
  const type = /^["']/.test(scanner.peek()) ? '' : scanner.next();
  const prim = { name: scanner.text(), type, specifier, parent, attributes: new Map(), metadata: new Map() };
  readMetadata(scanner, prim);
  scanner.expect('{');
  return prim;
}

/** Reads metadata in parentheses, if there are any: the known ones, and whether there is a composition arc. */
function readMetadata(scanner: Scanner, to: WithMetadata): void {
  if (scanner.peek() !== '(') return;
  scanner.next();
  for (let word = scanner.next(); word !== ')'; word = scanner.next()) {
    if (word === '') scanner.fault('")"', '');
    const isDeleted = word === 'delete' || word === 'reorder';
    const key = LIST_OPERATIONS.test(word) ? scanner.next() : word;
    // A text without a name is a comment.
    if (scanner.peek() !== '=') continue;
    scanner.next();
    const range = scanner.skipValue();
    const arc = ARCS.get(key);
    if (KEPT_METADATA.has(key)) {
      const value = scanner.parse(range, 'double');
      if (value !== undefined && !isDeleted) to.metadata.set(key, value);
    } else if (key === LAYER_DATA) {
      for (const [name, text] of scanner.dictionary(range)) to.metadata.set(DATA_PREFIX + name, text);
    } else if (arc && !isDeleted && !scanner.isEmpty(range)) to.arc ??= arc;
    // The path of a reference within its asset, and its offset in time.
    while (/^[<(]/.test(scanner.peek())) scanner.skipValue();
  }
}

function skipReorder(scanner: Scanner): void {
  scanner.next();
  scanner.expect('=');
  scanner.skipValue();
}

function skipVariants(scanner: Scanner, prim: UsdPrim): void {
  prim.arc ??= ARCS.get('variantSets');
  scanner.text();
  scanner.expect('=');
  scanner.skipValue();
}

/** Reads an attribute or a relationship: `[custom] [uniform] type[[]] name[.timeSamples] [= value] [(metadata)]`. */
function readProperty(scanner: Scanner, first: string, { attributes }: UsdPrim): void {
  let type = first;
  while (QUALIFIERS.test(type) || LIST_OPERATIONS.test(type)) type = scanner.next();
  if (!/^\w/.test(type)) scanner.fault('an attribute', type);
  if (scanner.peek() === '[') {
    scanner.next();
    scanner.expect(']');
  }
  const [, name, field] = /^([^.]+)(?:\.(\w+))?$/.exec(scanner.next()) ?? scanner.fault('the name of an attribute', '');
  if (scanner.peek() === '=') {
    scanner.next();
    scanner.take(ATTRIBUTE_BYTES);
    const precision = precisionOf(type);
    const known = attributes.get(name);
    if (field === 'timeSamples') attributes.set(name, { ...known, samples: readSamples(scanner, precision) });
    else {
      const value = lateValue(scanner, precision);
      if (field === undefined && type !== 'rel') attributes.set(name, { ...known, value });
    }
  }
  if (scanner.peek() === '(') scanner.skipValue();
}

/** Precision of a type of numbers, such as `half3`, `quath` or `matrix4d`. */
function precisionOf(type: string): Precision {
  if (/^(double|timecode)|d$/.test(type)) return 'double';
  return /^half|h$/.test(type) ? 'half' : 'float';
}

function lateValue(scanner: Scanner, precision: Precision): LateValue {
  const range = scanner.skipValue();
  return () => scanner.parse(range, precision);
}

function readSamples(scanner: Scanner, precision: Precision): UsdAttribute['samples'] {
  scanner.expect('{');
  const samples: { time: number; value: LateValue }[] = [];
  for (let word = scanner.next(); word !== '}'; word = scanner.next()) {
    if (word === ',') continue;
    // A time may be written without a space before its colon.
    const time = Number(word.replace(/:$/, ''));
    if (word === '' || Number.isNaN(time)) scanner.fault('the time of a sample', word);
    if (!word.endsWith(':')) scanner.expect(':');
    scanner.take(ATTRIBUTE_BYTES);
    samples.push({ time, value: lateValue(scanner, precision) });
  }
  return samples.sort((a, b) => a.time - b.time);
}
