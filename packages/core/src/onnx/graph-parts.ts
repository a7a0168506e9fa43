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
/** Maximum rank of a stored tensor whose dimensions are kept; no rule needs more. */
const KEPT_RANK = 8;
/** Maximum length of a tensor of 64-bit integers that is read: shapes for Reshape are that short. */
const SHAPE_BYTES = 8 * KEPT_RANK;
/** Maximum rank of a tensor. */
const RANK_LIMIT = 64;
/** Maximum nesting of subgraphs, as in `If` and `Loop`, before a file counts as hostile. */
const DEPTH_LIMIT = 32;

/** Parts of a graph for the header, collected over all nesting levels. */
export interface Harvest {
  readonly operators: string[];
  readonly externalFiles: ExternalFile[];
  /** Names of initializers of the outermost graph. */
  readonly initializers: string[];
  /** Nodes of this level and below, in the order of the file. */
  readonly nodes: OnnxNode[];
  /** Stored tensors of any level, by name. */
  readonly stored: Map<string, OnnxValue>;
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

/** `ValueInfoProto`: name and type of an input or output. */
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

/** `NodeProto`: its operator, inputs, outputs, and attributes. */
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

type NodeAttributes = { -readonly [Key in 'numbers' | 'lists' | 'value']?: OnnxNode[Key] };

/** `MatMul` for ONNX's own domain, `com.example:Name` for others. */
export function operatorName(domain: string, operator: string): string {
  return domain === '' || domain === 'ai.onnx' ? operator : `${domain}:${operator}`;
}

/** `AttributeProto`: integers, lists of integers and tensors are kept; subgraphs are collected. */
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
    else if (field.number === 8) list.push(...packedVarints(bytes, field, KEPT_RANK));
    else if (field.number === 22 || field.number === 23) readSparseTensor(bytes, field, harvest);
    else if (field.number === 6 || field.number === 11) readSubgraph(bytes, field, harvest, depth + 1);
  }
  if (whole !== undefined) found.numbers = { ...found.numbers, [name]: whole };
  if (list.length > 0) found.lists = { ...found.lists, [name]: list };
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
 * `TensorProto`: name, type, shape, external files and size; the weights are skipped, except for shapes of other
 * tensors.
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
    if (field.number === 1) dims.push(...packedVarints(bytes, field, KEPT_RANK));
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

/** Integers in one packed field; none if there are more than `most`. */
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

/** `raw_data` of 64-bit integers, if it is short. */
function rawIntegers(bytes: LoadedBytes, { start, end }: Span): number[] {
  if (end - start > SHAPE_BYTES || (end - start) % 8 !== 0) return [];
  return Array.from({ length: (end - start) / 8 }, (_, i) => {
    let value = 0n;
    for (let k = 0; k < 8; k++) value |= BigInt(bytes.byteAt(start + 8 * i + k)) << BigInt(8 * k);
    return Number(BigInt.asIntN(64, value));
  });
}

/** `SparseTensorProto`: values and indices are tensors; the name is that of the values. */
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

/** Required length of an external file for one tensor, in bytes. */
function externalEnd(entries: ReadonlyMap<string, string>): number {
  const number = (key: string): number => {
    const value = Number(entries.get(key) ?? 0);
    return Number.isFinite(value) && value >= 0 ? value : 0;
  };
  return number('offset') + number('length');
}

/** `StringStringEntryProto`. */
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

/** `OperatorSetIdProto`. */
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

/** `FunctionProto`: name, and its operators. */
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
