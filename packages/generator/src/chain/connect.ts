import {
  ContractError,
  type AttributeSlice,
  type ContractFault,
  type GaussiansInput,
} from '@gaussian-splat/core/contract';
import { describeTensor, type OnnxTensor } from '@gaussian-splat/core/onnx';
import type { GeneratorModel } from '../runtime/open-model.js';

/**
 * An output of one model that is an input of the next. With an undefined output, the input receives the number of rows.
 */
export interface Connection {
  readonly output: string | undefined;
  readonly input: string;
  /** Dimensions of an input that receives the number of rows: each is 1, and a scalar has none. */
  readonly dims?: readonly number[];
}

/**
 * Matches the outputs of a model with the inputs of the next. Tensors are passed unchanged, so layout, activations,
 * orders and element type must be equal.
 * @throws ContractError `contract/chain`, with every fault.
 */
export function connect(before: GeneratorModel, after: GeneratorModel): Connection[] {
  const faults: ContractFault[] = [];
  const connections: Connection[] = [];
  const wanted = before.layout === undefined ? 'image' : 'gaussians';
  for (const input of after.header.inputs) {
    const binding = after.contract.inputs[input.name];
    if (binding.role !== wanted) continue;
    const found = binding.role === 'gaussians' ? gaussiansFor(before, binding) : { output: before.outputs[0].name };
    const misfit = 'misfit' in found ? found.misfit : shapeMisfit(before, found.output, input);
    if (misfit !== undefined) faults.push(cannotConnect(before, after, input, misfit));
    else if ('output' in found) {
      const dims = input.dims as readonly number[];
      connections.push({ output: found.output, input: input.name, ...(found.output === undefined ? { dims } : {}) });
    }
  }
  if (connections.length + faults.length === 0) faults.push(takesNothing(before, after, wanted));
  if (before.layout?.count !== undefined && faults.length === 0) faults.push(...lostCount(before, after, connections));
  if (faults.length > 0) throw new ContractError(faults);
  return connections;
}

type Found = { readonly output: string | undefined } | { readonly misfit: string };

/** Returns the output for an input with Gaussians, or a description of the output that does not fit. */
function gaussiansFor({ layout, contract }: GeneratorModel, wanted: GaussiansInput): Found {
  const { outputs } = contract;
  if (wanted.attribute === 'count') return { output: layout?.count };
  if (wanted.attribute === 'packed') {
    if (outputs.layout !== 'packed') return { misfit: `the layout ${outputs.layout}` };
    if (outputs.columns !== undefined) return { misfit: 'columns of an order of their own' };
    const same = (['color', 'opacityActivation', 'shOrder'] as const).find((key) => outputs[key] !== wanted[key]);
    return same ? { misfit: `${same} ${outputs[same]}, not ${wanted[same]}` } : { output: outputs.gaussians };
  }
  if (outputs.layout !== 'split') return { misfit: `the layout ${outputs.layout}` };
  const slice = layout?.attributes.find(({ attribute }) => attribute === wanted.attribute);
  if (slice === undefined) return { misfit: `no ${wanted.attribute}` };
  const misfit = activationMisfit(slice, wanted);
  return misfit ? { misfit } : { output: slice.tensor };
}

function activationMisfit(slice: AttributeSlice, wanted: GaussiansInput): string | undefined {
  const asked: Partial<Record<string, string>> = {
    opacities: wanted.opacityActivation ?? 'linear',
    scales: wanted.scaleActivation ?? 'linear',
    rotations: wanted.rotationOrder,
    sh: wanted.shOrder,
  };
  const written: Partial<Record<string, string>> = {
    opacities: slice.activation,
    scales: slice.activation,
    rotations: slice.quaternionOrder,
    sh: slice.shOrder,
  };
  const { attribute } = slice;
  if (asked[attribute] === written[attribute]) return undefined;
  return `${attribute} as ${written[attribute]}, not ${asked[attribute]}`;
}

/**
 * Returns a description of the output if its shape or element type does not fit the input; undefined if it does. A
 * fixed size must be equal on both sides; an open size accepts any.
 */
function shapeMisfit({ header }: GeneratorModel, output: string | undefined, input: OnnxTensor): string | undefined {
  const tensor = header.outputs.find(({ name }) => name === output);
  if (tensor === undefined) return undefined;
  const [from, to] = [tensor.dims ?? [], input.dims ?? []];
  const fits = from.length === to.length && to.every((size, i) => typeof size !== 'number' || size === from[i]);
  return fits && tensor.dtype === input.dtype ? undefined : `${tensor.name}, ${describeTensor(tensor)}`;
}

const cannotConnect = (
  before: GeneratorModel,
  after: GeneratorModel,
  input: OnnxTensor,
  found: string,
): ContractFault => ({
  code: 'contract/chain',
  tensor: input.name,
  where: `input ${input.name} of ${after.header.name}`,
  expected: `${describeTensor(input)} of ${before.header.name}, as the contract of the input declares it`,
  found,
  remedy: 'export both models with the same layout, activations, element type and number of rows',
});

const takesNothing = (before: GeneratorModel, after: GeneratorModel, role: string): ContractFault => ({
  code: 'contract/chain',
  where: after.header.name,
  expected: `an input with the role ${role}, for the outputs of ${before.header.name}`,
  found: 'none',
  remedy: 'put models into a chain in the order of their data',
});

/** Returns a fault if the next model does not receive the count of valid rows: later rows are undefined. */
function lostCount(
  before: GeneratorModel,
  after: GeneratorModel,
  connections: readonly Connection[],
): readonly ContractFault[] {
  if (connections.some(({ output }) => output === before.layout?.count)) return [];
  return [
    {
      code: 'contract/chain',
      where: after.header.name,
      expected: `an input with the role gaussians and the attribute count, since ${before.header.name} writes a count`,
      found: 'none',
      remedy: 'give the model such an input and a count of its own, or export the one before it without a count',
    },
  ];
}
