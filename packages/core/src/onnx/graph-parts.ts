import { ONNX_DTYPES, type ExternalFile, type OnnxDim, type OnnxDtype, type OnnxTensor } from './header.js';
import type { LoadedBytes } from './loaded-bytes.js';
import { FieldCursor, type Span } from './protobuf.js';

/** Longest name, in bytes, that is believed. */
export const NAME_LIMIT = 65_536;
/** Dimensions of the weights of a convolution over pictures: channels out and in, rows, columns. */
const CONV_RANK = 4;
/** Most dimensions of a tensor that are believed. */
const RANK_LIMIT = 64;
/** Subgraphs within subgraphs, as `If` and `Loop` have them, before a file counts as hostile. */
const DEPTH_LIMIT = 32;

/** The parts of a graph that a header reports, gathered from any level of nesting. */
export interface Harvest {
  readonly operators: string[];
  readonly externalFiles: ExternalFile[];
  /** Names of initializers of the outermost graph. */
  readonly initializers: string[];
  /** Names of the weights of convolutions. */
  readonly convWeights: string[];
  /** Shapes of weights that might be those of a convolution over pictures, by name. */
  readonly kernels: Map<string, readonly number[]>;
  /** Names of what casts read, and the element types that they write. */
  readonly castInputs: string[];
  readonly castTypes: OnnxDtype[];
  /** Element types of initializers by name. */
  readonly dtypes: Map<string, OnnxDtype>;
  /** Most outputs of a `Split`. */
  widestSplit: number;
  initializerBytes: number;
}

export const emptyHarvest = (): Harvest => ({
  operators: [],
  externalFiles: [],
  initializers: [],
  convWeights: [],
  kernels: new Map(),
  castInputs: [],
  castTypes: [],
  dtypes: new Map(),
  widestSplit: 0,
  initializerBytes: 0,
});

// Numbers of fields are those of https://github.com/onnx/onnx/blob/main/onnx/onnx.proto

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

/** What a `TypeProto` may hold besides a tensor, by field number. */
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
    // Exporters write -1 or 0 and an empty symbol for "not known"; 0 itself is a legal size.
    if (field.number === 1 && field.isVarint) dim = field.value >= 0 ? field.value : null;
    if (field.number === 2) dim = field.text(NAME_LIMIT) || null;
  }
  return dim;
}

/** `NodeProto`: its operator, and whatever its attributes hold. */
export function readNode(bytes: LoadedBytes, span: Span, harvest: Harvest, depth = 0): void {
  let operator = '';
  let domain = '';
  const inputs: string[] = [];
  let outputs = 0;
  let castTo = 0;
  const field = new FieldCursor(bytes, span);
  while (field.next()) {
    if (field.number === 1 && inputs.length < 2) inputs.push(field.text(NAME_LIMIT));
    else if (field.number === 2) outputs++;
    else if (field.number === 4) operator = field.text(NAME_LIMIT);
    else if (field.number === 7) domain = field.text(NAME_LIMIT);
    else if (field.number === 5 && field.isDelimited) castTo = readAttribute(bytes, field, harvest, depth) ?? castTo;
  }
  const full = operatorName(domain, operator);
  harvest.operators.push(full);
  if (full === 'Conv' && inputs.length > 1) harvest.convWeights.push(inputs[1]);
  if (full === 'Split') harvest.widestSplit = Math.max(harvest.widestSplit, outputs);
  if (full !== 'Cast') return;
  harvest.castInputs.push(...inputs.slice(0, 1));
  harvest.castTypes.push(ONNX_DTYPES[castTo] ?? 'unknown');
}

/** `MatMul` in ONNX's own domain, `com.example:Name` elsewhere. */
export function operatorName(domain: string, operator: string): string {
  return domain === '' || domain === 'ai.onnx' ? operator : `${domain}:${operator}`;
}

/** `AttributeProto`. @returns the whole number of the attribute `to`, which casts have */
function readAttribute(bytes: LoadedBytes, span: Span, harvest: Harvest, depth: number): number | undefined {
  let name = '';
  let whole: number | undefined;
  const field = new FieldCursor(bytes, span);
  while (field.next()) {
    if (field.number === 3 && field.isVarint) whole = field.value;
    if (!field.isDelimited) continue;
    if (field.number === 1) name = field.text(NAME_LIMIT);
    else if (field.number === 5 || field.number === 10) readTensor(bytes, field, harvest);
    else if (field.number === 22 || field.number === 23) readSparseTensor(bytes, field, harvest);
    else if (field.number === 6 || field.number === 11) readSubgraph(bytes, field, harvest, depth + 1);
  }
  return name === 'to' ? whole : undefined;
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

/** `TensorProto`: name, external files and size; the weights are passed over. */
export function readTensor(bytes: LoadedBytes, span: Span, harvest: Harvest): string {
  let name = '';
  const entries = new Map<string, string>();
  const dims: number[] = [];
  let dtype: OnnxDtype = 'unknown';
  const field = new FieldCursor(bytes, span);
  while (field.next()) {
    if (field.number === 1 && field.isVarint && dims.length <= CONV_RANK) dims.push(field.value);
    else if (field.number === 2 && field.isVarint) dtype = ONNX_DTYPES[field.value] ?? 'unknown';
    else if (field.number === 8) name = field.text(NAME_LIMIT);
    else if (field.number === 13 && field.isDelimited) readEntry(bytes, field, entries, NAME_LIMIT);
  }
  harvest.initializerBytes += span.end - span.start;
  const location = entries.get('location');
  if (dims.length === CONV_RANK) harvest.kernels.set(name, dims);
  harvest.dtypes.set(name, dtype);
  if (location !== undefined) harvest.externalFiles.push({ location, byteLength: externalEnd(entries) });
  return name;
}

/** `SparseTensorProto`: values and indices are tensors; the first names the whole. */
export function readSparseTensor(bytes: LoadedBytes, span: Span, harvest: Harvest): string {
  let name = '';
  const field = new FieldCursor(bytes, span);
  while (field.next()) {
    if (!field.isDelimited) continue;
    if (field.number === 1) name = readTensor(bytes, field, harvest);
    else if (field.number === 2) readTensor(bytes, field, harvest);
  }
  return name;
}

/** Bytes that an external file must have for one tensor. */
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

/** `FunctionProto`: name, and the operators that it uses. */
export function readFunction(bytes: LoadedBytes, span: Span, harvest: Harvest): string {
  let name = '';
  let domain = '';
  const field = new FieldCursor(bytes, span);
  while (field.next()) {
    if (field.number === 1) name = field.text(NAME_LIMIT);
    else if (field.number === 10) domain = field.text(NAME_LIMIT);
    else if (field.number === 7 && field.isDelimited) readNode(bytes, field, harvest);
  }
  return operatorName(domain, name);
}
