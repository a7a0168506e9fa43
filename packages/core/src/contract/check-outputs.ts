import type { Vector3 } from '../vector.js';
import type { ContractFault } from './contract-error.js';
import type { Contract } from './contract.js';
import { checkRow, type RowFault, type RowReader } from './gaussian-values.js';
import { halfToNumber } from '../half.js';
import { attributeSlices, type AttributeSlice } from './layout.js';
import { tensorNames } from './parse-contract.js';
import { bareDims, describeShapes, outputRule, type TensorRule } from './tensor-rules.js';
import type { OutputTensor } from './instances.js';

export type { OutputTensor };

/** Result of {@link checkOutputs}. */
export interface OutputReport {
  /** Every fault; values of the same kind in one tensor are one fault that names the first row and their number. */
  readonly faults: readonly ContractFault[];
  /** Rows of the tensors. */
  readonly rows: number;
  /** Live rows: `count` if it is written, else all. Only these are checked. */
  readonly live: number;
  /** Box of the live, finite centers in world units; undefined if there are none. */
  readonly bounds: { readonly min: Vector3; readonly max: Vector3 } | undefined;
}

/**
 * Checks the output of one run of a generator: shapes, live count, finite numbers, covariances positive semi-definite,
 * scales and opacities in range. A pure function over arrays, which runs in browsers and in Node.
 *
 * @param outputs Outputs of the run, by the names in the file.
 */
export function checkOutputs(contract: Contract, outputs: Readonly<Record<string, OutputTensor>>): OutputReport {
  const faults = checkShapes(contract, outputs);
  if (faults.length > 0) return { faults, rows: 0, live: 0, bounds: undefined };
  if (contract.outputs.layout === 'image') {
    return { faults: checkImage(contract.outputs.image, outputs), rows: 0, live: 0, bounds: undefined };
  }
  const fields = new Map(tensorNames(contract.outputs).map(([field, name]) => [name, field]));
  const dimsOf = (name: string): readonly number[] =>
    writtenDims(outputs[name], outputRule(contract.outputs, fields.get(name)!))!;
  const slices = attributeSlices(contract.outputs, (name) => columnsOf(dimsOf(name)));
  const rows = dimsOf(slices[0].tensor)[0];
  const max = Math.min(rows, contract.nMax ?? rows);
  const { live, countFaults } = liveRows(contract.outputs.count, outputs, max);
  const readers = slices.map((slice) => readerOf(slice, outputs[slice.tensor]));
  const rowFaults = collectRowFaults(readers, live);
  const of = (name: string): RowReader => readers.find(({ attribute }) => attribute === name)!;
  const bounds = boundsOf(of('positions'), of('opacities'), live);
  return {
    faults: [...countFaults, ...rowFaults],
    rows,
    live,
    bounds,
  };
}

/**
 * Whether the centers of a run lie within the bounds that the contract declares, up to rounding. Bounds hold for all
 * times and views, with default controls, poses and shapes: other runs may exceed them.
 */
export function checkBounds({ bounds: declared, outputs, dtype }: Contract, { bounds }: OutputReport): ContractFault[] {
  if (!declared || !bounds) return [];
  const extent = Math.max(...declared.max.map((max, axis) => max - declared.min[axis]));
  const farthest = Math.max(...[...declared.min, ...declared.max].map(Math.abs));
  // For a single Gaussian, or a small scene far away, the extent says nothing about the rounding error.
  const slack = Math.max(1e-3 * extent, farthest * (dtype === 'float16' ? 2 ** -11 : 2 ** -23));
  const isInside = [0, 1, 2].every(
    (axis) => bounds.min[axis] >= declared.min[axis] - slack && bounds.max[axis] <= declared.max[axis] + slack,
  );
  if (isInside) return [];
  const show = ({ min, max }: { min: Vector3; max: Vector3 }): string => `${min.join(' ')} to ${max.join(' ')}`;
  const tensor = outputs.layout === 'split' ? outputs.positions : tensorNames(outputs)[0][1];
  return [
    {
      code: 'contract/conflict',
      tensor,
      where: `output ${tensor}, positions`,
      expected: `centres within the declared bounds, ${show(declared)}`,
      found: show(bounds),
      remedy: 'widen bounds in the contract',
    },
  ];
}

/** Compares a second run with the same inputs: every output must hold the same numbers, bit for bit. */
export function compareRuns(
  contract: Contract,
  first: Readonly<Record<string, OutputTensor>>,
  second: Readonly<Record<string, OutputTensor>>,
): ContractFault[] {
  if (Object.values(contract.inputs).some(({ role }) => role === 'seed')) return [];
  return tensorNames(contract.outputs).flatMap(([, name]) => {
    const [a, b] = [first[name], second[name]];
    const at = a && b ? firstDifference(a, b) : -1;
    if (at < 0) return [];
    return [
      {
        code: 'contract/not-deterministic',
        tensor: name,
        where: `output ${name}`,
        expected: 'the same numbers for the same inputs, as no input has the role seed',
        found:
          a.data.length === b.data.length
            ? `other numbers, first at element ${at}`
            : `dims [${a.dims}], then [${b.dims}]`,
        remedy: 'give the model an input with the role seed, or take the random numbers out of it',
      },
    ];
  });
}

function firstDifference(a: OutputTensor, b: OutputTensor): number {
  if (a.data.length !== b.data.length || a.dims.some((dim, i) => dim !== b.dims[i])) return 0;
  for (let i = 0; i < a.data.length; i++) if (!Object.is(a.data[i], b.data[i])) return i;
  return -1;
}

const columnsOf = (dims: readonly number[]): number => dims.slice(1).reduce((product, dim) => product * dim, 1);

/**
 * Dimensions without leading ones; undefined if they do not match the rule. Zero Gaussians are valid; otherwise N is
 * positive.
 */
function writtenDims({ dims, data }: OutputTensor, rule: TensorRule): readonly number[] | undefined {
  const isEmpty = data.length === 0 && dims.includes(0);
  const filled = isEmpty ? dims.map((dim) => dim || EMPTY) : dims;
  return (bareDims(filled, rule) as readonly number[] | undefined)?.map((dim) => (isEmpty && dim === EMPTY ? 0 : dim));
}

/** Marks zero rows; no other dimension has this size. */
const EMPTY = 2 ** 31;

/** Checks presence, shape and row counts of the outputs; values can be read only if these are valid. */
function checkShapes(
  { outputs: binding, nMax }: Contract,
  outputs: Readonly<Record<string, OutputTensor>>,
): ContractFault[] {
  let rows: { name: string; count: number } | undefined;
  const isCounted = binding.layout !== 'image' && binding.count !== undefined;
  return tensorNames(binding).flatMap(([field, name]): ContractFault[] => {
    const where = `output ${name} (${field})`;
    const tensor = Object.hasOwn(outputs, name) ? outputs[name] : undefined;
    if (tensor === undefined) {
      const found = Object.keys(outputs).join(', ') || 'nothing';
      const remedy = 'correct the name in the contract, or export the model with it';
      return [{ code: 'contract/missing-tensor', tensor: name, where, expected: 'this output', found, remedy }];
    }
    const rule = outputRule(binding, field);
    const dims = writtenDims(tensor, rule);
    const length = tensor.dims.reduce((product, dim) => product * dim, 1);
    if (dims === undefined || length !== tensor.data.length) {
      const found = `[${tensor.dims.join(', ')}] with ${tensor.data.length} numbers`;
      const remedy = 'write the tensor in the shape that the contract declares';
      return [{ code: 'contract/shape', tensor: name, where, expected: describeShapes(rule), found, remedy }];
    }
    if (field === 'count' || field === 'image') return [];
    const count = dims[0];
    rows ??= { name, count };
    const common = { code: 'contract/rows', tensor: name, where, found: `${count} rows` } as const;
    if (count !== rows.count) {
      const expected = `${rows.count} rows, as ${rows.name} has`;
      return [{ ...common, expected, remedy: 'write as many rows of every attribute' }];
    }
    return nMax !== undefined && count > nMax && !isCounted
      ? [{ ...common, expected: `at most nMax = ${nMax} rows`, remedy: 'raise nMax in the contract' }]
      : [];
  });
}

function liveRows(
  name: string | undefined,
  outputs: Readonly<Record<string, OutputTensor>>,
  rows: number,
): { live: number; countFaults: ContractFault[] } {
  if (name === undefined) return { live: rows, countFaults: [] };
  // An int64 is a BigInt.
  const count = Number(outputs[name].data[0]);
  if (Number.isInteger(count) && count >= 0 && count <= rows) return { live: count, countFaults: [] };
  const fault: ContractFault = {
    code: 'contract/count',
    tensor: name,
    where: `output ${name}`,
    expected: `a live count of 0 to ${rows}, the number of rows (or nMax)`,
    found: String(count),
    remedy: 'clamp the count in the model',
  };
  return { live: Math.min(Math.max(0, Math.trunc(count) || 0), rows), countFaults: [fault] };
}

/** Reads one attribute of any row as numbers, for any element type. */
function readerOf(slice: AttributeSlice, { dtype, data }: OutputTensor): RowReader {
  const isBits = dtype === 'float16' && data instanceof Uint16Array;
  const { offset, rowStride } = slice;
  const read = isBits
    ? (row: number, component: number): number => halfToNumber(data[row * rowStride + offset + component])
    : (row: number, component: number): number => data[row * rowStride + offset + component];
  return { ...slice, isHalf: dtype === 'float16', read };
}

/** Checks all live rows and reports one fault for each kind and tensor. */
function collectRowFaults(readers: readonly RowReader[], live: number): ContractFault[] {
  const kinds = new Map<string, { fault: RowFault; reader: RowReader; row: number; count: number }>();
  for (const reader of readers) {
    for (let row = 0; row < live; row++) {
      const fault = checkRow(reader, row);
      if (fault === undefined) continue;
      const key = `${reader.attribute} ${fault.code}`;
      const kind = kinds.get(key);
      if (kind) kind.count++;
      else kinds.set(key, { fault, reader, row, count: 1 });
    }
  }
  return [...kinds.values()].map(({ fault, reader, row, count }) => ({
    code: fault.code,
    tensor: reader.tensor,
    where: `output ${reader.tensor}, ${reader.attribute} of row ${row}`,
    expected: fault.expected,
    found: `${fault.found}${count > 1 ? `; in ${count} of ${live} rows` : ''}`,
    remedy: fault.remedy,
  }));
}

/** Opacities below this are not drawn: they change no pixel of 8 bits. */
const MIN_OPACITY = 1 / 255;

/** Corners around the finite centers of the rows that are drawn. */
function boundsOf({ read }: RowReader, opacities: RowReader, live: number): OutputReport['bounds'] {
  const lowest = opacities.activation === 'logit' ? Math.log(MIN_OPACITY / (1 - MIN_OPACITY)) : MIN_OPACITY;
  const min: [number, number, number] = [Infinity, Infinity, Infinity];
  const max: [number, number, number] = [-Infinity, -Infinity, -Infinity];
  for (let row = 0; row < live; row++) {
    if (opacities.read(row, 0) < lowest) continue;
    for (let axis = 0; axis < 3; axis++) {
      const value = read(row, axis);
      if (!Number.isFinite(value)) continue;
      if (value < min[axis]) min[axis] = value;
      if (value > max[axis]) max[axis] = value;
    }
  }
  return min.every(Number.isFinite) ? { min, max } : undefined;
}

function checkImage(name: string, outputs: Readonly<Record<string, OutputTensor>>): ContractFault[] {
  const { data, dtype } = outputs[name];
  const isBits = dtype === 'float16' && data instanceof Uint16Array;
  for (let i = 0; i < data.length; i++) {
    const value = isBits ? halfToNumber(data[i]) : data[i];
    if (Number.isFinite(value)) continue;
    return [
      {
        code: 'contract/not-finite',
        tensor: name,
        where: `output ${name}, element ${i}`,
        expected: 'finite numbers',
        found: String(value),
        remedy: 'find the operation that divides by zero or overflows',
      },
    ];
  }
  return [];
}
