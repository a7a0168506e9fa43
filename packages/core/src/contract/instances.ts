import type { OnnxDim, OnnxHeader, OnnxTensor } from '../onnx/header.js';
import type { ContractFault } from './contract-error.js';
import type { Contract } from './contract.js';
import { tensorNames } from './parse-contract.js';

/** Value of one output of a run. */
export interface OutputTensor {
  readonly dtype: string;
  readonly dims: readonly number[];
  /** Elements in row-major order. Float16 is a `Uint16Array` of bits, or a `Float16Array` if the browser supports it. */
  readonly data: ArrayLike<number>;
}

/** Roles of inputs that cannot have an axis of instances. */
const SHARED_ROLES: readonly string[] = ['gaussians', 'image', 'depth', 'state'];

/** Whether the first dimension of a tensor is the axis of instances of the contract. */
export function hasInstances({ dims }: Pick<OnnxTensor, 'dims'>, { instances }: Contract): boolean {
  return instances !== undefined && dims?.[0] === instances.axis;
}

/**
 * Returns the header of one instance, to which the rules of roles and layouts apply: shapes without the axis of instances.
 * Returns the header itself if the contract declares no instances.
 */
export function oneInstance(header: OnnxHeader, contract: Contract): OnnxHeader {
  if (contract.instances === undefined) return header;
  return withAxis(header, contract, (rest) => rest);
}

/** Returns the header of a run of `count` instances: that number replaces the axis in shapes. */
export function ofInstances(header: OnnxHeader, contract: Contract, count: number): OnnxHeader {
  return withAxis(header, contract, (rest) => [count, ...rest]);
}

function withAxis(header: OnnxHeader, contract: Contract, change: (rest: OnnxDim[]) => OnnxDim[]): OnnxHeader {
  const changed = (tensor: OnnxTensor): OnnxTensor =>
    hasInstances(tensor, contract) ? { ...tensor, dims: change(tensor.dims!.slice(1)) } : tensor;
  return { ...header, inputs: header.inputs.map(changed), outputs: header.outputs.map(changed) };
}

/** Returns the outputs of one instance of a run, without the axis of instances. @param instance Index of the instance. */
export function outputsOfInstance(
  outputs: Readonly<Record<string, OutputTensor>>,
  instance: number,
): Record<string, OutputTensor> {
  const parts = Object.entries(outputs).map(([name, { dtype, dims, data }]) => {
    const size = dims.slice(1).reduce((product, dim) => product * dim, 1);
    const part = partOf(data, instance * size, (instance + 1) * size);
    return [name, { dtype, dims: dims.slice(1), data: part }] as const;
  });
  return Object.fromEntries(parts);
}

/** Returns the elements from `start` to `end`: a view of a typed array, or a copy of another list. */
function partOf(data: ArrayLike<number>, start: number, end: number): ArrayLike<number> {
  return ArrayBuffer.isView(data) ? (data as Float32Array).subarray(start, end) : Array.from(data).slice(start, end);
}

/**
 * Returns the faults of a contract's instances. The axis must be the first dimension of every output that the contract
 * names and of at least one input, and must occur nowhere else. The other dimensions of outputs must be numbers. Images,
 * states and inputs from other models cannot have instances.
 */
export function checkInstances(header: OnnxHeader, contract: Contract): ContractFault[] {
  const { instances, outputs, inputs } = contract;
  if (instances === undefined) return [];
  const { axis } = instances;
  const fault = (where: string, expected: string, found: string, remedy: string, tensor?: string): ContractFault => ({
    code: 'contract/instances',
    tensor,
    where,
    expected,
    found,
    remedy,
  });
  if (outputs.layout === 'image') {
    return [fault('instances', 'a model that writes Gaussians', 'a post-processor', 'leave out instances')];
  }
  const state = Object.entries(inputs).find(([, { role }]) => role === 'state');
  if (state !== undefined) {
    const remedy = 'leave out instances: each would need a state of its own';
    return [fault(`input ${state[0]}`, 'a model without a state', 'an input with the role state', remedy, state[0])];
  }
  const names = new Set(tensorNames(outputs).map(([, name]) => name));
  const written = header.outputs.filter(({ name, dims }) => names.has(name) && dims !== undefined);
  const roleOf = ({ name }: OnnxTensor): string => (Object.hasOwn(inputs, name) ? inputs[name].role : '');
  return [
    ...written
      .filter((output) => !hasInstances(output, contract))
      .map(({ name, dims }) => {
        const remedy = `export it with the symbolic axis ${axis} before all others`;
        return fault(`output ${name}`, `${axis} as its first dimension`, `[${dims!.join(', ')}]`, remedy, name);
      }),
    // Fixed sizes give each instance the same offset in every run.
    ...written
      .filter(
        (output) => hasInstances(output, contract) && output.dims!.slice(1).some((dim) => typeof dim !== 'number'),
      )
      .map(({ name, dims }) => {
        const remedy = 'fix N; unused rows may lie behind a count, or have opacity 0';
        return fault(`output ${name}`, `numbers behind ${axis}`, `[${dims!.join(', ')}]`, remedy, name);
      }),
    ...[...header.inputs, ...written]
      .filter(({ dims }) => dims?.slice(1).includes(axis))
      .map(({ name, dims }) => {
        const remedy = 'give the axis of instances a unique name, and put it first';
        return fault(`tensor ${name}`, `${axis} as the first dimension only`, `[${dims!.join(', ')}]`, remedy, name);
      }),
    ...header.inputs
      .filter((input) => hasInstances(input, contract) && SHARED_ROLES.includes(roleOf(input)))
      .map(({ name, dims }) => {
        const remedy = 'export it without the axis';
        return fault(`input ${name}`, 'a tensor that all instances share', `[${dims!.join(', ')}]`, remedy, name);
      }),
    ...(header.inputs.some((input) => hasInstances(input, contract))
      ? []
      : [
          fault(
            'instances',
            `an input whose first dimension is ${axis}`,
            'none',
            'leave out instances: all would be equal',
          ),
        ]),
  ];
}
