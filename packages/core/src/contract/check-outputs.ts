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
  /** All faults. Invalid values of one kind in one attribute are one fault, with the first row and the number of rows. */
  readonly faults: readonly ContractFault[];
  /** Number of rows of the tensors; 0 if their shapes are invalid, and for an image. */
  readonly rows: number;
  /** Number of valid rows, which are checked: the value of `count` if the contract names one, else {@link rows} up to `nMax`. */
  readonly live: number;
  /** Box of the finite centers of valid rows with an opacity of 1/255 or more, in world units; undefined if there are none. */
  readonly bounds: { readonly min: Vector3; readonly max: Vector3 } | undefined;
}

/**
 * Checks the outputs of one run: shapes, the count of valid rows, that numbers are finite, that covariances are positive
 * semi-definite, and that scales and opacities are in range. Values are checked only if all shapes are valid.
 *
 * @param outputs Outputs of the run, by their names in the file.
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
 * Returns a fault if centers of a run lie outside the bounds that the contract declares, except for rounding. Call it
 * for runs with default controls, poses and shapes: other runs may exceed the bounds.
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
      expected: `centers within the declared bounds, ${show(declared)}`,
      found: show(bounds),
      remedy: 'widen bounds in the contract',
    },
  ];
}

/** Returns a fault for each output that differs between two runs with the same inputs; none if an input is a seed. */
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
        expected: 'the same numbers for the same inputs, because no input has the role seed',
        found:
          a.data.length === b.data.length
            ? `other numbers, first at element ${at}`
            : `dims [${a.dims}], then [${b.dims}]`,
        remedy: 'give the model an input with the role seed, or remove its random numbers',
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
 * Returns the dimensions of an output without leading dimensions of 1; undefined if they do not match the rule. N may
 * be 0 in an output without elements.
 */
function writtenDims({ dims, data }: OutputTensor, rule: TensorRule): readonly number[] | undefined {
  const isEmpty = data.length === 0 && dims.includes(0);
  const filled = isEmpty ? dims.map((dim) => dim || EMPTY) : dims;
  return (bareDims(filled, rule) as readonly number[] | undefined)?.map((dim) => (isEmpty && dim === EMPTY ? 0 : dim));
}

/** Replaces N = 0 in comparisons with a rule, which require N > 0. No dimension has this size. */
const EMPTY = 2 ** 31;

/** Checks that the outputs exist, and that their shapes and numbers of rows are valid, so that values can be read. */
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
      return [{ ...common, expected, remedy: 'write the same number of rows for every attribute' }];
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
  // An int64 tensor contains BigInts.
  const count = Number(outputs[name].data[0]);
  if (Number.isInteger(count) && count >= 0 && count <= rows) return { live: count, countFaults: [] };
  const fault: ContractFault = {
    code: 'contract/count',
    tensor: name,
    where: `output ${name}`,
    expected: `a count of 0 to ${rows}, the number of rows (or nMax)`,
    found: String(count),
    remedy: 'clamp the count in the model',
  };
  return { live: Math.min(Math.max(0, Math.trunc(count) || 0), rows), countFaults: [fault] };
}

/** Returns a reader of one attribute. It converts float16 bits to numbers. */
function readerOf(slice: AttributeSlice, { dtype, data }: OutputTensor): RowReader {
  const isBits = dtype === 'float16' && data instanceof Uint16Array;
  const { offset, rowStride } = slice;
  const read = isBits
    ? (row: number, component: number): number => halfToNumber(data[row * rowStride + offset + component])
    : (row: number, component: number): number => data[row * rowStride + offset + component];
  return { ...slice, isHalf: dtype === 'float16', read };
}

/** Checks all valid rows. Returns one fault for each attribute and kind of fault, with the number of its rows. */
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

/** Minimum opacity of a splat that is drawn: a lower one changes no 8-bit pixel. */
const MIN_OPACITY = 1 / 255;

/** Returns the box of the finite centers of the rows that are drawn; undefined if there are none. */
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
