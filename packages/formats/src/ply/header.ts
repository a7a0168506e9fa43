import { GaussianSplatError } from '@gaussian-splat/core';
import { asciiOf, grouped, quote } from '../bytes.js';
import type { SceneSource } from '../scene-format.js';
import { MAX_HEADER_BYTES, USUAL_HEADER_BYTES } from '../signatures.js';

const SCALARS = [
  ...(['int8', 'uint8', 'int16', 'uint16', 'int32', 'uint32', 'int64', 'uint64'] as const),
  ...(['float32', 'float64'] as const),
] as const;
export type ScalarType = (typeof SCALARS)[number];

export interface PlyProperty {
  readonly name: string;
  /** Type of the value, or of each value of a list. */
  readonly type: ScalarType;
  /** Type of the length of a list. Absent for a scalar property. */
  readonly listCountType?: ScalarType;
}

export interface PlyElement {
  readonly name: string;
  /** Number of rows of the element. */
  readonly count: number;
  readonly properties: readonly PlyProperty[];
}

export interface PlyHeader {
  readonly encoding: 'ascii' | 'little-endian' | 'big-endian';
  readonly elements: readonly PlyElement[];
  /** Text of each comment line, after the word `comment`. */
  readonly comments: readonly string[];
  /** Byte offset in the file of the first row, after the header. */
  readonly dataStart: number;
}

/**
 * Types by their names in files: those of the PLY specification, and those with sizes in bits. 64-bit integers are not in
 * the specification, but occur in files.
 */
const TYPES: ReadonlyMap<string, ScalarType> = new Map([
  ...SCALARS.map((type): [string, ScalarType] => [type, type]),
  ['char', 'int8'],
  ['uchar', 'uint8'],
  ['short', 'int16'],
  ['ushort', 'uint16'],
  ['int', 'int32'],
  ['uint', 'uint32'],
  ['longlong', 'int64'],
  ['ulonglong', 'uint64'],
  ['float', 'float32'],
  ['double', 'float64'],
]);

const ENCODINGS: ReadonlyMap<string, PlyHeader['encoding']> = new Map([
  ['ascii', 'ascii'],
  ['binary_little_endian', 'little-endian'],
  ['binary_big_endian', 'big-endian'],
]);

/** Size in bytes of one binary value. */
export function sizeOf(type: ScalarType): number {
  return Number(/\d+/.exec(type)) / 8;
}

/**
 * Whether float32 cannot represent all numbers of a type. Coordinates of such a type need an origin, which depends on all
 * splats.
 */
export function exceedsFloat32(type: ScalarType): boolean {
  return type !== 'float32' && sizeOf(type) >= 4;
}

/**
 * Parses the header of a PLY file. Lines may end with LF, CRLF or CR.
 * @throws GaussianSplatError `decode/header`, `decode/truncated`
 */
export function parsePlyHeader(source: SceneSource): PlyHeader {
  const { lines, dataStart } = splitHeader(source);
  const elements: { name: string; count: number; properties: PlyProperty[] }[] = [];
  /**
   * Names of all elements, and names of the properties of the last element. Sets are fast enough for headers with a
   * hundred thousand lines.
   */
  const [names, own] = [new Set<string>(), new Set<string>()];
  const comments: string[] = [];
  let encoding: PlyHeader['encoding'] | undefined;
  lines.forEach((line, index) => {
    const fail = headerFailure(source, line, index + 1);
    // A trimmed line would lose the last byte of some characters of UTF-8.
    const [keyword = '', ...words] = line.split(/[ \t]+/).filter((word) => word !== '');
    if (keyword === 'format') {
      encoding = ENCODINGS.get(words[0]);
      if (!encoding || words[1] !== '1.0') fail('format ascii, binary_little_endian or binary_big_endian 1.0');
    } else if (keyword === 'comment') {
      comments.push(words.join(' '));
    } else if (keyword === 'element') {
      elements.push(parseElement(words, names, fail));
      own.clear();
    } else if (keyword === 'property') {
      const element = elements.at(-1) ?? fail('an element before its properties');
      element.properties.push(parseProperty(words, own, fail));
    } else if (keyword !== '' && keyword !== 'obj_info' && index > 0) {
      fail('format, comment, obj_info, element or property');
    }
  });
  if (!encoding) return headerFailure(source, '', undefined)('a line that begins with "format"');
  return { encoding, elements, comments, dataStart };
}

type Fail = (expected: string) => never;

function parseElement(words: readonly string[], elements: Set<string>, fail: Fail) {
  const [name, text] = words;
  const count = Number(text);
  if (words.length !== 2 || !/^\d+$/.test(text) || !Number.isSafeInteger(count)) fail('"element NAME COUNT"');
  if (elements.has(name)) fail(`one element named ${quote(name)}`);
  elements.add(name);
  return { name, count, properties: [] };
}

function parseProperty(words: readonly string[], properties: Set<string>, fail: Fail): PlyProperty {
  const isList = words[0] === 'list';
  if (words.length !== (isList ? 4 : 2)) fail('"property TYPE NAME" or "property list COUNT_TYPE TYPE NAME"');
  const name = words[words.length - 1];
  const type = TYPES.get(words[words.length - 2]) ?? fail(`a type out of ${[...TYPES.keys()].join(', ')}`);
  if (properties.has(name)) fail(`one property named ${quote(name)} in the element`);
  properties.add(name);
  if (!isList) return { name, type };
  const listCountType = TYPES.get(words[1]);
  if (!listCountType || listCountType.startsWith('float')) return fail('an integer type for the length of a list');
  return { name, type, listCountType };
}

/**
 * Returns the lines before `end_header`, and the byte offset after that line.
 * @param length Number of bytes to search; if the header is longer, {@link MAX_HEADER_BYTES} are searched.
 */
function splitHeader(source: SceneSource, length = USUAL_HEADER_BYTES): { lines: string[]; dataStart: number } {
  const { bytes, name } = source;
  const text = asciiOf(bytes, 0, length);
  // If lines end with CR, a byte 10 after `end_header` belongs to the data. Otherwise LF ends every line, with an
  // optional CR before it.
  const usesLoneCr = /^[^\r\n]*\r(?!\n)/.test(text);
  const end = (usesLoneCr ? /\rend_header[ \t]*(\r|$)/ : /\r?\nend_header[ \t]*\r?(\n|$)/).exec(text);
  const isWithin = end !== null && end.index + end[0].length < length;
  if (!isWithin && length < Math.min(bytes.length, MAX_HEADER_BYTES)) return splitHeader(source, MAX_HEADER_BYTES);
  if (end) {
    const lines = text.slice(0, end.index).split(usesLoneCr ? '\r' : /\r?\n/);
    return { lines, dataStart: end.index + end[0].length };
  }
  const isCut = bytes.length < MAX_HEADER_BYTES;
  throw new GaussianSplatError(isCut ? 'decode/truncated' : 'decode/header', {
    where: `${name}, PLY header, byte ${grouped(Math.min(bytes.length, MAX_HEADER_BYTES))}`,
    expected: 'a line "end_header"',
    found: isCut ? 'the end of the file' : `none in the first ${grouped(MAX_HEADER_BYTES)} bytes`,
    remedy: isCut ? 'download or export the file again; it is incomplete' : 'export the file again as a PLY of splats',
  });
}

function headerFailure(source: SceneSource, line: string, lineNumber: number | undefined): Fail {
  return (expected) => {
    throw new GaussianSplatError('decode/header', {
      where: `${source.name}, PLY header${lineNumber === undefined ? '' : `, line ${lineNumber}`}`,
      expected,
      found: line === '' ? 'none' : quote(line),
      remedy: 'export the file again; the header breaks the PLY specification',
    });
  };
}
