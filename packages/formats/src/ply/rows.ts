import { GaussianSplatError } from '@gaussian-splat/core';
import { grouped, hostIsLittleEndian, viewOf } from '../bytes.js';
import type { SceneSource } from '../scene-format.js';
import { AsciiCursor, BinaryCursor, scalarGetter, type ValueCursor } from './cursors.js';
import { sizeOf, type PlyElement, type PlyHeader } from './header.js';

/** Destination of the values of one property: row i goes to `array[i·stride + offset]`. */
export interface ColumnTarget {
  readonly property: string;
  readonly array: Float32Array | Float64Array | Uint32Array | Uint8Array;
  readonly stride: number;
  readonly offset: number;
}

/** An element of a PLY file. `start` is the byte offset of its first row. */
export interface ElementData {
  readonly source: SceneSource;
  readonly encoding: PlyHeader['encoding'];
  readonly element: PlyElement;
  readonly start: number;
  /** Size of each row in bytes. Undefined for text and for rows with lists, which have no fixed size. */
  readonly rowBytes: number | undefined;
}

/**
 * Finds an element of the header by its name, and skips the elements before. The file is long enough for its rows, so
 * that a caller may allocate memory for `element.count` rows. If the file is a prefix, `element.count` is reduced.
 * @throws GaussianSplatError `decode/truncated`
 */
export function openElement(source: SceneSource, header: PlyHeader, name: string): ElementData {
  const { encoding } = header;
  let start = header.dataStart;
  for (const element of header.elements) {
    const rowBytes = fixedRowBytes(element, encoding);
    const data: ElementData = { source, encoding, element, start, rowBytes };
    if (element.name === name && source.isPrefix && rowBytes !== undefined) return wholeRows(data, rowBytes);
    requireRoom(data);
    if (element.name === name) return data;
    start = endOf(data);
  }
  throw new Error(`no element ${name}: callers ask only for elements of the header`);
}

/** Returns an element with a count of only the rows that are complete, for a file that is still loading. */
function wholeRows(data: ElementData, rowBytes: number): ElementData {
  const { element, source, start } = data;
  const rows = Math.max(0, Math.floor((source.bytes.length - start) / Math.max(1, rowBytes)));
  return { ...data, element: { ...element, count: Math.min(element.count, rows) } };
}

/** Copies properties of all rows to their targets. Throws `decode/truncated`, or `decode/corrupt` for invalid text. */
export function readColumns(data: ElementData, targets: readonly ColumnTarget[]): void {
  if (data.rowBytes === undefined) readSequentially(data, targets);
  else if (canViewAsFloats(data, targets)) readFloats(data, targets);
  else readFixedRows(data, targets);
}

function fixedRowBytes(element: PlyElement, encoding: PlyHeader['encoding']): number | undefined {
  const { properties } = element;
  if (properties.length > 0 && encoding === 'ascii') return undefined;
  if (properties.some((property) => property.listCountType)) return undefined;
  return properties.reduce((sum, property) => sum + sizeOf(property.type), 0);
}

/** Returns the minimum size of a row in bytes, for checks before memory is allocated. */
function minimumRowBytes({ element, encoding, rowBytes }: ElementData): number {
  if (rowBytes !== undefined) return rowBytes;
  // Each value of a text file has at least a digit and a separator.
  const sizes = element.properties.map(({ type, listCountType }) =>
    encoding === 'ascii' ? 2 : sizeOf(listCountType ?? type),
  );
  return sizes.reduce((sum, size) => sum + size, 0);
}

function requireRoom(data: ElementData): void {
  const { source, element, start, encoding } = data;
  const minimum = minimumRowBytes(data);
  // The separator after the last value of a text file may be missing.
  const present = source.bytes.length - start + (encoding === 'ascii' ? 1 : 0);
  if (element.count * minimum > present) throwTruncated(data, Math.floor(present / minimum));
}

function throwTruncated(data: ElementData, rows: number): never {
  const { source, element, start, rowBytes } = data;
  const what = element.name === 'vertex' ? 'splats' : `rows of element "${element.name}"`;
  const size = rowBytes === undefined ? '' : ` of ${rowBytes} bytes`;
  throw new GaussianSplatError('decode/truncated', {
    where: `${source.name}, byte ${grouped(source.bytes.length)} (end of the file)`,
    expected: `${grouped(element.count)} ${what}${size} from byte ${grouped(start)} on`,
    found: `${rowBytes === undefined ? 'at most ' : ''}${grouped(rows)} of ${grouped(element.count)}`,
    remedy: 'download or export the file again; it is incomplete',
  });
}

/** Returns a cursor at the first row of an element. */
export function cursorAt({ source, encoding, start }: ElementData): ValueCursor {
  return encoding === 'ascii'
    ? new AsciiCursor(source, start)
    : new BinaryCursor(source, start, encoding === 'little-endian');
}

function endOf(data: ElementData): number {
  if (data.rowBytes !== undefined) return data.start + data.element.count * data.rowBytes;
  return readSequentially(data, []);
}

/** Reads rows value by value, and copies properties to their targets. Returns the byte offset after the last row. */
function readSequentially(data: ElementData, targets: readonly ColumnTarget[]): number {
  const { element } = data;
  const cursor = cursorAt(data);
  const columns = element.properties.map((property) => ({
    ...property,
    target: targets.find((target) => target.property === property.name),
  }));
  for (let row = 0; row < element.count; row++) {
    for (const { name, type, listCountType, target } of columns) {
      if (listCountType) skipList(data, cursor, name, listCountType, type);
      else if (target) target.array[row * target.stride + target.offset] = cursor.next(type);
      else cursor.skip(type, 1);
      if (cursor.ended) throwTruncated(data, row);
    }
  }
  return cursor.position;
}

/** Moves the cursor past a list. Throws `decode/corrupt` for an invalid length. */
export function skipList(
  data: ElementData,
  cursor: ValueCursor,
  property: string,
  countType: Parameters<ValueCursor['next']>[0],
  type: Parameters<ValueCursor['next']>[0],
): void {
  const at = cursor.position;
  const length = cursor.next(countType);
  if (cursor.ended) return;
  if (!Number.isInteger(length) || length < 0) {
    throw new GaussianSplatError('decode/corrupt', {
      where: `${data.source.name}, byte ${grouped(at)}, element "${data.element.name}", property "${property}"`,
      expected: 'the length of a list, 0 or more',
      found: String(length),
      remedy: 'export the file again; its data is damaged',
    });
  }
  cursor.skip(type, length);
}

/** Returns, for each target that the element has, the byte offset of its property within a row, and a getter. */
function locateColumns({ element, encoding }: ElementData, targets: readonly ColumnTarget[]) {
  let at = 0;
  const columns = [];
  for (const { name, type } of element.properties) {
    const target = targets.find((candidate) => candidate.property === name);
    if (target) columns.push({ target, at, type, get: scalarGetter(type, encoding === 'little-endian') });
    at += sizeOf(type);
  }
  return columns;
}

/** Number of rows that are processed together, so that they remain in the cache while their columns are copied. */
const BLOCK_ROWS = 256;

function readFixedRows(data: ElementData, targets: readonly ColumnTarget[]): void {
  const { source, element, start } = data;
  const rowBytes = data.rowBytes ?? 0;
  const view = viewOf(source.bytes);
  const columns = locateColumns(data, targets);
  for (let first = 0; first < element.count; first += BLOCK_ROWS) {
    const last = Math.min(first + BLOCK_ROWS, element.count);
    for (const { target, at, get } of columns) {
      const { array, stride, offset } = target;
      for (let row = first; row < last; row++) {
        array[row * stride + offset] = get(view, start + row * rowBytes + at);
      }
    }
  }
}

/** Whether all targets are aligned float32 in the byte order of the host. They are read without a DataView, 3 times as fast. */
function canViewAsFloats(data: ElementData, targets: readonly ColumnTarget[]): boolean {
  return (
    hostIsLittleEndian &&
    data.encoding === 'little-endian' &&
    (data.rowBytes ?? 1) % 4 === 0 &&
    locateColumns(data, targets).every(({ at, type }) => type === 'float32' && at % 4 === 0)
  );
}

function readFloats(data: ElementData, targets: readonly ColumnTarget[]): void {
  const { source, element, start } = data;
  const rowBytes = data.rowBytes ?? 0;
  const parts = columnsByArray(data, targets);
  // Rows are copied to aligned memory, because their offsets in the file may not be multiples of 4.
  const block = new Uint8Array(BLOCK_ROWS * rowBytes);
  const floats = new Float32Array(block.buffer);
  for (let first = 0; first < element.count; first += BLOCK_ROWS) {
    const rows = Math.min(BLOCK_ROWS, element.count - first);
    const from = start + first * rowBytes;
    block.set(source.bytes.subarray(from, from + rows * rowBytes));
    for (const part of parts) copyColumns(floats, rowBytes / 4, rows, part, first);
  }
}

/** Columns whose destination is the same array: indices of floats in a row of the file, and in a row of the array. */
interface ArrayColumns {
  readonly array: ColumnTarget['array'];
  readonly stride: number;
  readonly from: Int32Array;
  readonly to: Int32Array;
}

/** Groups columns by their destination array, so that each row is written to adjacent memory. */
function columnsByArray(data: ElementData, targets: readonly ColumnTarget[]): ArrayColumns[] {
  const columns = locateColumns(data, targets).sort((a, b) => a.target.offset - b.target.offset);
  return [...new Set(columns.map(({ target }) => target.array))].map((array) => {
    const own = columns.filter(({ target }) => target.array === array);
    return {
      array,
      stride: own[0].target.stride,
      from: Int32Array.from(own, ({ at }) => at / 4),
      to: Int32Array.from(own, ({ target }) => target.offset),
    };
  });
}

function copyColumns(
  floats: Float32Array,
  rowFloats: number,
  rows: number,
  { array, stride, from, to }: ArrayColumns,
  first: number,
): void {
  for (let row = 0; row < rows; row++) {
    const source = row * rowFloats;
    const target = (first + row) * stride;
    for (let k = 0; k < from.length; k++) array[target + to[k]] = floats[source + from[k]];
  }
}
