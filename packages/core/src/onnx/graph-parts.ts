import {
  ONNX_DTYPES,
  type ExternalFile,
  type OnnxDim,
  type OnnxDtype,
  type OnnxNode,
  type OnnxTensor,
  type OnnxValue,
} from './header.js';
import type { LoadedBytes } from './loaded-bytes.js';
import { FieldCursor, type Span } from './protobuf.js';

/** Maximum length of a name in bytes. */
export const NAME_LIMIT = 65_536;
/** Maximum number of kept dimensions of a stored tensor, and of elements of an integer list. No rule needs more. */
const KEPT_RANK = 8;
/** Maximum bytes of a tensor of 64-bit integers whose values are read, such as a shape for Reshape. */
const SHAPE_BYTES = 8 * KEPT_RANK;
/** Maximum rank of an input, an output or an intermediate value. A file with a higher rank is corrupt. */
const RANK_LIMIT = 64;
/** Maximum nesting of subgraphs, as in `If` and `Loop`. A file with deeper nesting is corrupt. */
const DEPTH_LIMIT = 32;

/** Parts of a graph for the header, collected from all levels of nesting. */
export interface Harvest {
  readonly operators: string[];
  readonly externalFiles: ExternalFile[];
  /** Names of the initializers of the outermost graph. */
  readonly initializers: string[];
  /** Nodes of this level and of nested levels, in the order of the file. */
  readonly nodes: OnnxNode[];
  /** Stored tensors of all levels, by name. */
  readonly stored: Map<string, OnnxValue>;
  /** Number of bytes of weights in the file. */
  initializerBytes: number;
}

export const emptyHarvest = (): Harvest => ({
  operators: [],
  externalFiles: [],
  initializers: [],
  nodes: [],
  stored: new Map(),
  initializerBytes: 0,
});

// Field numbers are those of https://github.com/onnx/onnx/blob/main/onnx/onnx.proto

/** Reads a `ValueInfoProto`: name and type of an input or output. */
export function readValueInfo(bytes: LoadedBytes, span: Span): OnnxTensor {
  let name = '';
  let type: Pick<OnnxTensor, 'dtype' | 'dims'> = { dtype: 'unknown', dims: undefined };
  const field = new FieldCursor(bytes, span);
  while (field.next()) {
    if (field.number === 1) name = field.text(NAME_LIMIT);
    if (field.number === 2 && field.isDelimited) type = readType(bytes, field);
  }
  return { name, ...type };
}

/** Kinds of `TypeProto` other than a tensor, by field number. */
const NON_TENSORS: Readonly<Record<number, OnnxDtype>> = {
  4: 'sequence',
  5: 'map',
  7: 'opaque',
  8: 'sparse tensor',
  9: 'optional',
};

function readType(bytes: LoadedBytes, span: Span): Pick<OnnxTensor, 'dtype' | 'dims'> {
  let type: Pick<OnnxTensor, 'dtype' | 'dims'> = { dtype: 'unknown', dims: undefined };
  const field = new FieldCursor(bytes, span);
  while (field.next()) {
    if (field.number === 1 && field.isDelimited) type = readTensorType(bytes, field);
    else if (field.number in NON_TENSORS) type = { dtype: NON_TENSORS[field.number], dims: undefined };
  }
  return type;
}

function readTensorType(bytes: LoadedBytes, span: Span): Pick<OnnxTensor, 'dtype' | 'dims'> {
  let dtype: OnnxDtype = 'unknown';
  let dims: OnnxDim[] | undefined;
  const field = new FieldCursor(bytes, span);
  while (field.next()) {
    if (field.number === 1 && field.isVarint) dtype = ONNX_DTYPES[field.value] ?? 'unknown';
    if (field.number === 2 && field.isDelimited) dims = readShape(bytes, field);
  }
  return { dtype, dims };
}

function readShape(bytes: LoadedBytes, span: Span): OnnxDim[] {
  const dims: OnnxDim[] = [];
  const field = new FieldCursor(bytes, span);
  while (field.next()) {
    if (field.number !== 1 || !field.isDelimited) continue;
    if (dims.length === RANK_LIMIT) {
      throw bytes.fault('decode/corrupt', field.start, `at most ${RANK_LIMIT} dimensions`, 'more');
    }
    dims.push(readDim(bytes, field));
  }
  return dims;
}

function readDim(bytes: LoadedBytes, span: Span): OnnxDim {
  let dim: OnnxDim = null;
  const field = new FieldCursor(bytes, span);
  while (field.next()) {
    // Exporters write -1 or 0 and an empty symbol for an unknown size; 0 itself is a legal size.
    if (field.number === 1 && field.isVarint) dim = field.value >= 0 ? field.value : null;
    if (field.number === 2) dim = field.text(NAME_LIMIT) || null;
  }
  return dim;
}

/**
 * Reads a `NodeProto`, and adds its operator, inputs, outputs, attributes and subgraphs to the harvest.
 * @param depth Nesting of the node in subgraphs; 1 for a function.
 */
export function readNode(bytes: LoadedBytes, span: Span, harvest: Harvest, depth = 0): void {
  let operator = '';
  let domain = '';
  let name = '';
  const inputs: string[] = [];
  const outputs: string[] = [];
  const attributes: NodeAttributes = {};
  const field = new FieldCursor(bytes, span);
  while (field.next()) {
    if (field.number === 1) inputs.push(field.text(NAME_LIMIT));
    else if (field.number === 2) outputs.push(field.text(NAME_LIMIT));
    else if (field.number === 3) name = field.text(NAME_LIMIT);
    else if (field.number === 4) operator = field.text(NAME_LIMIT);
    else if (field.number === 7) domain = field.text(NAME_LIMIT);
    else if (field.number === 5 && field.isDelimited) readAttribute(bytes, field, harvest, attributes, depth);
  }
  const full = operatorName(domain, operator);
  harvest.operators.push(full);
  harvest.nodes.push({ name, operator: full, inputs, outputs, isInner: depth > 0, ...attributes });
}

interface NodeAttributes {
  numbers?: Record<string, number>;
  lists?: Record<string, readonly number[]>;
  value?: OnnxValue;
}

/** Returns the name of an operator: `MatMul` for ONNX's own domain, `com.example:Name` for others. */
export function operatorName(domain: string, operator: string): string {
  return domain === '' || domain === 'ai.onnx' ? operator : `${domain}:${operator}`;
}

/**
 * Reads an `AttributeProto`. Integers, lists of integers and tensors are kept in `found`; subgraphs are added to the
 * harvest.
 */
function readAttribute(bytes: LoadedBytes, span: Span, harvest: Harvest, found: NodeAttributes, depth: number): void {
  let name = '';
  let whole: number | undefined;
  let value: OnnxValue | undefined;
  const list: number[] = [];
  const field = new FieldCursor(bytes, span);
  while (field.next()) {
    if (field.number === 3 && field.isVarint) whole = field.value;
    else if (field.number === 8 && field.isVarint && list.length < KEPT_RANK) list.push(field.value);
    if (!field.isDelimited) continue;
    if (field.number === 1) name = field.text(NAME_LIMIT);
    else if (field.number === 5 || field.number === 10) value = readTensor(bytes, field, harvest).value;
    else if (field.number === 8 && list.length < KEPT_RANK) list.push(...packedVarints(bytes, field, KEPT_RANK));
    else if (field.number === 22 || field.number === 23) readSparseTensor(bytes, field, harvest);
    else if (field.number === 6 || field.number === 11) readSubgraph(bytes, field, harvest, depth + 1);
  }
  if (whole !== undefined) (found.numbers ??= {})[name] = whole;
  if (list.length > 0) (found.lists ??= {})[name] = list;
  if (value !== undefined && name === 'value') found.value = value;
}

function readSubgraph(bytes: LoadedBytes, span: Span, harvest: Harvest, depth: number): void {
  if (depth > DEPTH_LIMIT) {
    throw bytes.fault('decode/corrupt', span.start, `at most ${DEPTH_LIMIT} graphs within graphs`, 'more');
  }
  const field = new FieldCursor(bytes, span);
  while (field.next()) {
    if (!field.isDelimited) continue;
    if (field.number === 1) readNode(bytes, field, harvest, depth);
    else if (field.number === 5) readTensor(bytes, field, harvest);
    else if (field.number === 15) readSparseTensor(bytes, field, harvest);
  }
}

/**
 * Reads a `TensorProto`. Returns its name, type and shape, and adds it to the harvest. Weights are skipped, except for
 * short vectors of int64, which may be shapes of other tensors.
 */
export function readTensor(bytes: LoadedBytes, span: Span, harvest: Harvest): { name: string; value: OnnxValue } {
  let name = '';
  const entries = new Map<string, string>();
  const dims: number[] = [];
  let dtype: OnnxDtype = 'unknown';
  let integers: number[] = [];
  const field = new FieldCursor(bytes, span);
  while (field.next()) {
    if (field.number === 1 && field.isVarint && dims.length < KEPT_RANK) dims.push(field.value);
    else if (field.number === 2 && field.isVarint) dtype = ONNX_DTYPES[field.value] ?? 'unknown';
    else if (field.number === 7 && field.isVarint && integers.length < KEPT_RANK) integers.push(field.value);
    if (!field.isDelimited) continue;
    if (field.number === 1 && dims.length < KEPT_RANK) dims.push(...packedVarints(bytes, field, KEPT_RANK));
    else if (field.number === 7) integers = packedVarints(bytes, field, KEPT_RANK);
    else if (field.number === 8) name = field.text(NAME_LIMIT);
    else if (field.number === 9 && dtype === 'int64') integers = rawIntegers(bytes, field);
    else if (field.number === 13) readEntry(bytes, field, entries, NAME_LIMIT);
  }
  harvest.initializerBytes += span.end - span.start;
  const location = entries.get('location');
  const isShape = dtype === 'int64' && dims.length <= 1 && integers.length > 0;
  const value = { dtype, dims, ...(isShape ? { integers } : {}) };
  harvest.stored.set(name, value);
  if (location !== undefined) harvest.externalFiles.push({ location, byteLength: externalEnd(entries) });
  return { name, value };
}

/** Returns the integers of a packed field; empty if there are more than `max`. */
function packedVarints(bytes: LoadedBytes, span: Span, max: number): number[] {
  if (span.end - span.start > 10 * max) return [];
  const numbers: number[] = [];
  let at = span.start;
  while (at < span.end && numbers.length <= max) {
    let value = 0n;
    let byte = 0x80;
    for (let shift = 0n; byte >= 0x80 && at < span.end; shift += 7n) {
      byte = bytes.byteAt(at++);
      value |= BigInt(byte & 0x7f) << shift;
    }
    numbers.push(Number(BigInt.asIntN(64, value)));
  }
  return numbers.length > max ? [] : numbers;
}

/** Returns the 64-bit integers of `raw_data`; empty if the data are longer than {@link SHAPE_BYTES}. */
function rawIntegers(bytes: LoadedBytes, { start, end }: Span): number[] {
  if (end - start > SHAPE_BYTES || (end - start) % 8 !== 0) return [];
  return Array.from({ length: (end - start) / 8 }, (_, i) => {
    let value = 0n;
    for (let k = 0; k < 8; k++) value |= BigInt(bytes.byteAt(start + 8 * i + k)) << BigInt(8 * k);
    return Number(BigInt.asIntN(64, value));
  });
}

/** Reads a `SparseTensorProto`, whose values and indices are tensors. Returns the name of the values. */
export function readSparseTensor(bytes: LoadedBytes, span: Span, harvest: Harvest): string {
  let name = '';
  const field = new FieldCursor(bytes, span);
  while (field.next()) {
    if (!field.isDelimited) continue;
    if (field.number === 1) name = readTensor(bytes, field, harvest).name;
    else if (field.number === 2) readTensor(bytes, field, harvest);
  }
  return name;
}

/** Returns the minimum bytes of the external file that contains a tensor: its offset plus its length; 0 if unknown. */
function externalEnd(entries: ReadonlyMap<string, string>): number {
  const number = (key: string): number => {
    const value = Number(entries.get(key) ?? 0);
    return Number.isFinite(value) && value >= 0 ? value : 0;
  };
  return number('offset') + number('length');
}

/** Reads a `StringStringEntryProto` into `entries`. @param valueLimit Maximum length of the value in bytes. */
export function readEntry(bytes: LoadedBytes, span: Span, entries: Map<string, string>, valueLimit: number): void {
  let key = '';
  let value = '';
  const field = new FieldCursor(bytes, span);
  while (field.next()) {
    if (field.number === 1) key = field.text(NAME_LIMIT);
    if (field.number === 2) value = field.text(valueLimit);
  }
  entries.set(key, value);
}

/** Reads an `OperatorSetIdProto`. The domain of ONNX itself, which may be empty in the file, is `ai.onnx`. */
export function readOpset(bytes: LoadedBytes, span: Span): [domain: string, version: number] {
  let domain = '';
  let version = 0;
  const field = new FieldCursor(bytes, span);
  while (field.next()) {
    if (field.number === 1) domain = field.text(NAME_LIMIT);
    if (field.number === 2 && field.isVarint) version = field.value;
  }
  return [domain || 'ai.onnx', version];
}

/** Reads a `FunctionProto`, and adds its operators to the harvest. Returns its name. */
export function readFunction(bytes: LoadedBytes, span: Span, harvest: Harvest): string {
  let name = '';
  let domain = '';
  const field = new FieldCursor(bytes, span);
  while (field.next()) {
    if (field.number === 1) name = field.text(NAME_LIMIT);
    else if (field.number === 10) domain = field.text(NAME_LIMIT);
    else if (field.number === 7 && field.isDelimited) readNode(bytes, field, harvest, 1);
  }
  return operatorName(domain, name);
}
