import { describeTensor, type OnnxDim, type OnnxHeader, type OnnxTensor } from '../onnx/header.js';
import type { ContractFault } from './contract-error.js';
import type { Contract, ControlInput, InputBinding, OutputBinding, PoseInput, StateInput } from './contract.js';
import { checkFile, type CheckFileOptions } from './check-file.js';
import { checkInstances, oneInstance } from './instances.js';
import { tensorNames } from './parse-contract.js';
import {
  bareDims,
  describeShapes,
  findTensor,
  inputRule,
  outputRule,
  POSE_NUMBERS,
  shapeFits,
  shDegreeOf,
  type TensorRule,
} from './tensor-rules.js';

/**
 * Checks the header of a file against a contract, without a runtime: names, shapes, element types, numbers of Gaussians,
 * opsets, operators and external files.
 * @returns All faults; empty if the file satisfies the contract.
 */
export function checkContract(file: OnnxHeader, contract: Contract, options: CheckFileOptions = {}): ContractFault[] {
  const header = oneInstance(file, contract);
  return [
    ...checkFile(file, options),
    ...checkInstances(file, contract),
    ...header.inputs.flatMap((input) => checkInput(input, contract, header)),
    ...missingInputs(header, contract),
    ...depthOfGenerators(contract),
    ...checkOutputTensors(header, contract.outputs),
    ...checkGaussians(header, contract),
  ];
}

function checkInput(
  input: OnnxTensor,
  { inputs }: Contract,
  { outputs }: Pick<OnnxHeader, 'outputs'>,
): ContractFault[] {
  const binding = Object.hasOwn(inputs, input.name) ? inputs[input.name] : undefined;
  if (binding === undefined) return [unboundInput(input)];
  const where = `input ${input.name} (${binding.role})`;
  const rule = inputRule(binding);
  const dtypes = binding.role === 'state' ? STATE_DTYPES : CONTROL_DTYPES;
  const faults = rule ? checkTensor(input, rule, where) : checkAnyShape(input, where, dtypes);
  if (faults.length > 0) return faults;
  if (binding.role === 'state') return checkState(input, binding, where, outputs);
  const lengths = checkDefault(input, binding, where);
  return binding.role === 'control' ? [...lengths, ...checkWhole(input, binding, where)] : lengths;
}

function unboundInput({ name, ...tensor }: OnnxTensor): ContractFault {
  return {
    code: 'contract/unbound-input',
    tensor: name,
    where: `input ${name}`,
    expected: 'a role in the contract',
    found: `none for ${describeTensor(tensor)}`,
    remedy: `add ${JSON.stringify(name)} to the contract's inputs, for example as a control with range and default`,
  };
}

function missingInputs(header: OnnxHeader, { inputs }: Contract): ContractFault[] {
  const found = new Set(header.inputs.map(({ name }) => name));
  const optional = new Set(header.optionalInputs);
  return Object.keys(inputs)
    .filter((name) => !found.has(name))
    .map((name) =>
      optional.has(name)
        ? optionalInput(name, inputs[name].role)
        : missingTensor('input', name, inputs[name].role, header.inputs),
    );
}

/** Rejects inputs with the role `depth` in generators. */
function depthOfGenerators({ inputs, outputs }: Contract): ContractFault[] {
  if (outputs.layout === 'image') return [];
  return Object.keys(inputs)
    .filter((name) => inputs[name].role === 'depth')
    .map((name) => ({
      code: 'contract/schema',
      tensor: name,
      where: `input ${name} (depth)`,
      expected: 'a post-processor, with the layout image',
      found: `a model with the layout ${outputs.layout}`,
      remedy: 'remove the input: no frame is drawn before a generator runs',
    }));
}

/** Fault of an input whose default is an initializer: ONNX allows callers to override it, but onnxruntime-web does not. */
const optionalInput = (name: string, role: string): ContractFault => ({
  code: 'contract/missing-tensor',
  tensor: name,
  where: `input ${name} (${role})`,
  expected: 'an input without a value in the file',
  found: 'one whose value is an initializer of the file, which ONNX Runtime in a page does not replace',
  remedy: 'export it without a default, or leave it out of the contract',
});

function missingTensor(
  kind: 'input' | 'output',
  name: string,
  role: string,
  tensors: readonly OnnxTensor[],
): ContractFault {
  const names = tensors.slice(0, 20).map((tensor) => tensor.name);
  return {
    code: 'contract/missing-tensor',
    tensor: name,
    where: `${kind} ${name} (${role})`,
    expected: `an ${kind} of this name in the file`,
    found: names.length > 0 ? `${kind}s ${names.join(', ')}` : `no ${kind}s`,
    remedy: `correct the name in the contract, or export the model with it`,
  };
}

/** Checks the shape and the element type of one tensor. */
function checkTensor(tensor: OnnxTensor, rule: TensorRule, where: string): ContractFault[] {
  const faults: ContractFault[] = [];
  const common = { tensor: tensor.name, where };
  if (tensor.dims === undefined) {
    const remedy = 'run onnx.shape_inference.infer_shapes on the model, or declare the shape at export';
    faults.push({
      ...common,
      code: 'contract/shape',
      expected: describeShapes(rule),
      found: 'no shape in the file',
      remedy,
    });
  } else if (!shapeFits(tensor.dims, rule)) {
    const isRow = /\(gaussians\)$/.test(where) && typeof tensor.dims.slice(1).at(-1) === 'number';
    const remedy = isRow
      ? 'export rows of this width, or declare your columns in outputs.columns, in their order'
      : 'export the tensor in this shape; fixed sizes must be numbers, not symbols';
    const found = `[${tensor.dims.map((dim) => dim ?? '?').join(', ')}]`;
    faults.push({ ...common, code: 'contract/shape', expected: describeShapes(rule), found, remedy });
  }
  if (!rule.dtypes.includes(tensor.dtype)) {
    const [expected, found] = [rule.dtypes.join(' or '), tensor.dtype];
    faults.push({
      ...common,
      code: 'contract/dtype',
      expected,
      found,
      remedy: `cast it to ${rule.dtypes[0]} at export`,
    });
  }
  return faults;
}

const CONTROL_DTYPES: TensorRule['dtypes'] = ['float32', 'int32', 'int64'];
const STATE_DTYPES: TensorRule['dtypes'] = ['float32', 'float16', 'int32'];

/** Checks that the output that feeds a state has the shape and element type of its input. */
function checkState(
  input: OnnxTensor,
  { output }: StateInput,
  where: string,
  outputs: readonly OnnxTensor[],
): ContractFault[] {
  const written = findTensor(outputs, output);
  if (written === undefined) return [missingTensor('output', output, 'state', outputs)];
  const isSame =
    written.dtype === input.dtype &&
    written.dims?.length === input.dims?.length &&
    written.dims?.every((dim, i) => dim === input.dims?.[i]);
  if (isSame) return [];
  const remedy = 'export both in the same shape and element type';
  const [expected, found] = [`${describeTensor(input)}, as the output ${output}`, describeTensor(written)];
  return [{ code: 'contract/shape', tensor: output, where, expected, found, remedy }];
}

/**
 * Checks that the range and the default of an integer control are integers: within int32, or safe integers of JavaScript
 * for int64.
 */
function checkWhole(
  { name, dtype }: OnnxTensor,
  { range, default: initial }: ControlInput,
  where: string,
): ContractFault[] {
  if (dtype !== 'int32' && dtype !== 'int64') return [];
  const fits = dtype === 'int32' ? (x: number): boolean => x === (x | 0) : Number.isSafeInteger;
  const numbers = { range, default: [initial].flat() };
  return (['range', 'default'] as const).flatMap((field) => {
    const wrong = numbers[field].find((value) => !fits(value));
    if (wrong === undefined) return [];
    const remedy = `correct ${field} in the contract, or export the input as float32`;
    const expected = `whole numbers that ${dtype} holds`;
    return [
      { code: 'contract/conflict', tensor: name, where: `${where}, ${field}`, expected, found: String(wrong), remedy },
    ];
  });
}

function checkAnyShape(input: OnnxTensor, where: string, dtypes: TensorRule['dtypes']): ContractFault[] {
  // The rule is the shape of the tensor itself, which fits only if all its sizes are fixed.
  const shape = input.dims?.map((dim) => (typeof dim === 'number' && dim > 0 ? dim : 'size'));
  return checkTensor(input, { shapes: [shape ?? ['any fixed sizes']], dtypes }, where);
}

/** Checks that the lists of a binding (defaults, names, joints, parents) have the lengths that the tensor requires. */
function checkDefault({ name, dims }: OnnxTensor, binding: InputBinding, where: string): ContractFault[] {
  const size = elementCount(dims ?? []);
  const lengths: [field: string, length: number | undefined, expected: number][] = [];
  if (binding.role === 'control') lengths.push(['default', lengthOf(binding.default), size]);
  if (binding.role === 'shape')
    lengths.push(['default', binding.default?.length, size], ['names', binding.names?.length, size]);
  if (binding.role === 'pose') {
    lengths.push(['default', binding.default?.length, size]);
    if (binding.format !== 'parameters') {
      const joints = size / POSE_NUMBERS[binding.format];
      if (!Number.isInteger(joints)) return [oddPose(name, binding.format, size, where)];
      lengths.push(['joints', binding.joints?.length, joints], ['parents', binding.parents?.length, joints]);
    }
  }
  return lengths
    .filter(([, length, expected]) => length !== undefined && length !== expected)
    .map(([field, length, expected]) => ({
      code: 'contract/shape',
      tensor: name,
      where: `${where}, ${field}`,
      expected: `a list of ${expected}, as the tensor has`,
      found: `a list of ${length}`,
      remedy: `correct ${field} in the contract`,
    }));
}

const oddPose = (tensor: string, format: PoseInput['format'], size: number, where: string): ContractFault => ({
  code: 'contract/shape',
  tensor,
  where,
  expected: `${POSE_NUMBERS[format]} numbers for each joint (${format})`,
  found: `${size} numbers`,
  remedy: 'correct format in the contract; "parameters" is for model-specific poses',
});

const lengthOf = (value: ControlInput['default']): number | undefined =>
  typeof value === 'number' ? undefined : value.length;

const elementCount = (dims: readonly OnnxDim[]): number =>
  dims.reduce<number>((product, dim) => product * Number(dim), 1);

function checkOutputTensors(header: OnnxHeader, outputs: OutputBinding): ContractFault[] {
  return tensorNames(outputs).flatMap(([field, name]) => {
    const tensor = findTensor(header.outputs, name);
    if (tensor === undefined) return [missingTensor('output', name, field, header.outputs)];
    return checkTensor(tensor, outputRule(outputs, field), `output ${name} (${field})`);
  });
}

/** Checks that all Gaussian outputs agree in rows and element type, and have the declared degree of harmonics. */
function checkGaussians(header: OnnxHeader, contract: Contract): ContractFault[] {
  const { outputs } = contract;
  const tensors = tensorNames(outputs).flatMap(([field, name]) => {
    const tensor = findTensor(header.outputs, name);
    const dims = tensor?.dims && bareDims(tensor.dims, outputRule(outputs, field));
    return tensor && dims && field !== 'count' && field !== 'image' ? [{ field, ...tensor, dims }] : [];
  });
  return [...checkRows(tensors, contract), ...checkDtypes(tensors, contract), ...checkShDegree(tensors, contract)];
}

interface GaussianOutput extends OnnxTensor {
  readonly field: string;
  readonly dims: readonly OnnxDim[];
}

function checkRows(tensors: readonly GaussianOutput[], { nMax, outputs }: Contract): ContractFault[] {
  // Rows after the live ones are padding.
  const isCounted = outputs.layout !== 'image' && outputs.count !== undefined;
  const faults: ContractFault[] = [];
  const fixed = tensors.filter(({ dims }) => typeof dims[0] === 'number');
  const [first] = fixed;
  for (const { name, dims } of fixed) {
    const common = { code: 'contract/rows', tensor: name, where: `output ${name}`, found: `N = ${dims[0]}` } as const;
    if (dims[0] !== first.dims[0]) {
      const expected = `N = ${first.dims[0]}, as ${first.name} has`;
      faults.push({ ...common, expected, remedy: 'write the same number of rows for every attribute' });
    }
    if (nMax !== undefined && Number(dims[0]) > nMax && !isCounted) {
      const remedy = 'raise nMax in the contract, or name a count: the rows behind it are then padding';
      faults.push({ ...common, expected: `at most nMax = ${nMax} rows`, remedy });
    }
  }
  const [symbolic] = tensors.filter(({ dims }) => typeof dims[0] !== 'number');
  if (symbolic && fixed.length === 0 && nMax === undefined) {
    faults.push({
      code: 'contract/rows',
      tensor: symbolic.name,
      where: `output ${symbolic.name}`,
      expected: 'a number of rows, or nMax in the contract',
      found: `N = ${symbolic.dims[0] ?? 'unknown'} and no nMax`,
      remedy: 'declare nMax, the maximum number of Gaussians of one run',
    });
  }
  return faults;
}

function checkDtypes(tensors: readonly GaussianOutput[], { dtype }: Contract): ContractFault[] {
  const floats = tensors.filter((tensor) => tensor.dtype === 'float32' || tensor.dtype === 'float16');
  const expected = dtype ?? floats[0]?.dtype;
  return floats
    .filter((tensor) => tensor.dtype !== expected)
    .map(({ name, dtype: found }) => ({
      code: 'contract/dtype',
      tensor: name,
      where: `output ${name}`,
      expected: dtype ? `${dtype}, as the contract declares` : `${expected}, as ${floats[0].name} has`,
      found,
      remedy: 'write all Gaussian outputs in one element type, and declare that one',
    }));
}

function checkShDegree(tensors: readonly GaussianOutput[], { outputs, shDegree }: Contract): ContractFault[] {
  const tensor = tensors.find(({ field }) => field === 'sh' || (outputs.layout === 'packed' && field === 'gaussians'));
  if (shDegree === undefined || outputs.layout === 'image') return [];
  // Plain colors count as degree 0.
  const found = (tensor && shDegreeOf(outputs, tensor.dims)) ?? 0;
  if (found === shDegree || (tensor === undefined && tensorNames(outputs).some(([field]) => field === 'sh'))) return [];
  return [
    {
      code: 'contract/sh-degree',
      tensor: tensor?.name,
      where: tensor ? `output ${tensor.name}` : 'shDegree',
      expected: `harmonics of degree ${shDegree}, as the contract declares`,
      found: tensor ? `degree ${found} (${describeTensor(tensor)})` : 'plain colors',
      remedy: 'correct shDegree in the contract, or leave it out',
    },
  ];
}
