import type { OnnxHeader, OnnxTensor } from '../onnx/header.js';
import { ContractError, type ContractFault } from './contract-error.js';
import type { Contract, InputBinding, OutputBinding } from './contract.js';
import { shOrderOf } from './tensor-rules.js';
import { inferVisionary } from './visionary.js';

/** An inferred contract. `notes` state its assumptions, in sentences without a full stop. */
export interface InferredContract {
  readonly contract: Contract;
  readonly notes: readonly string[];
}

/** Bindings of inputs by their canonical names. */
const CANONICAL_INPUTS: Readonly<Record<string, (input: OnnxTensor) => InputBinding>> = {
  view: () => ({ role: 'view', order: 'row-major', axes: 'RDF' }),
  projection: () => ({ role: 'projection', order: 'row-major', axes: 'RDF' }),
  view_projection: () => ({ role: 'view_projection', order: 'row-major' }),
  camera_position: () => ({ role: 'camera_position' }),
  viewport: () => ({ role: 'viewport' }),
  time: () => ({ role: 'time', unit: 'seconds' }),
  frame: () => ({ role: 'frame' }),
  seed: () => ({ role: 'seed' }),
  pose: inferPose,
  shape: () => ({ role: 'shape' }),
  image: () => ({ role: 'image' }),
};

function inferPose({ dims = [] }: OnnxTensor): InputBinding {
  const [, ...joint] = dims.length > 2 && dims[0] === 1 ? dims.slice(1) : dims;
  switch (joint.join()) {
    case '3':
      return { role: 'pose', format: 'axis-angle' };
    case '4':
      return { role: 'pose', format: 'quaternion', quaternionOrder: 'wxyz' };
    case '3,3':
      return { role: 'pose', format: 'matrix' };
    default:
      return { role: 'pose', format: 'parameters' };
  }
}

/**
 * Infers a contract from the names of inputs and outputs: canonical names, or those of Visionary's exporters.
 * @throws ContractError `contract/inference` with a fault for each input that has another name, and one for the outputs.
 */
export function inferContract(header: OnnxHeader): InferredContract {
  const visionary = inferVisionary(header);
  if (visionary) return visionary;
  const faults: ContractFault[] = [];
  const outputs = inferOutputs(header);
  if (outputs === undefined) faults.push(unknownOutputs(header));
  const inputs: Record<string, InputBinding> = {};
  for (const input of header.inputs) {
    const infer = Object.hasOwn(CANONICAL_INPUTS, input.name) ? CANONICAL_INPUTS[input.name] : undefined;
    if (infer) inputs[input.name] = infer(input);
    else faults.push(unknownInput(input));
  }
  if (outputs === undefined || faults.length > 0) throw new ContractError(faults);
  return { contract: { version: 1, inputs, outputs }, notes: notesOf(inputs, outputs) };
}

function inferOutputs({ outputs }: OnnxHeader): OutputBinding | undefined {
  const named = (name: string): OnnxTensor | undefined => outputs.find((output) => output.name === name);
  const count = named('count') ? { count: 'count' } : {};
  const gaussians = named('gaussians');
  if (gaussians) {
    const isPlain = gaussians.dims?.at(-1) === 13;
    const color = isPlain ? ({ color: 'rgb' } as const) : ({ color: 'sh', shOrder: 'coefficient-major' } as const);
    return { layout: 'packed', gaussians: 'gaussians', ...color, opacityActivation: 'linear', ...count };
  }
  if (named('positions') && named('opacities')) return inferSplit(named, count);
  return named('image') ? { layout: 'image', image: 'image' } : undefined;
}

function inferSplit(
  named: (name: string) => OnnxTensor | undefined,
  count: { count?: string },
): OutputBinding | undefined {
  const isFactored = named('scales') !== undefined && named('rotations') !== undefined;
  const sh = named('sh');
  if ((!isFactored && !named('covariances')) || (!sh && !named('colors'))) return undefined;
  return {
    layout: 'split',
    positions: 'positions',
    ...(isFactored
      ? { scales: 'scales', scaleActivation: 'linear', rotations: 'rotations', rotationOrder: 'wxyz' }
      : { covariances: 'covariances' }),
    ...(sh ? { sh: 'sh', shOrder: shOrderOf(sh) } : { colors: 'colors' }),
    opacities: 'opacities',
    opacityActivation: 'linear',
    ...count,
  };
}

function notesOf(inputs: Contract['inputs'], outputs: OutputBinding): string[] {
  const bindings = Object.entries(inputs).map(
    ([name, { role, ...details }]) => `input ${name} is ${role}${list(details)}`,
  );
  const { layout, ...details } = outputs;
  return [...bindings, `outputs are ${layout}${list(details)}`];
}

function list(details: object): string {
  const entries = Object.entries(details).map(([key, value]) => `${key} ${String(value)}`);
  return entries.length > 0 ? ` (${entries.join(', ')})` : '';
}

function unknownInput({ name }: OnnxTensor): ContractFault {
  return {
    code: 'contract/inference',
    tensor: name,
    where: `input ${name}`,
    expected: `a contract, or one of the names ${Object.keys(CANONICAL_INPUTS).join(', ')}`,
    found: 'no contract and another name',
    remedy: 'write a contract: see docs/contract.md',
  };
}

function unknownOutputs({ outputs }: OnnxHeader): ContractFault {
  const names = outputs.slice(0, 20).map(({ name }) => name);
  return {
    code: 'contract/inference',
    where: 'outputs',
    expected:
      'a contract, or outputs named gaussians; or positions, opacities, covariances (or scales and rotations) and ' +
      'colors (or sh); or image',
    found: names.length > 0 ? `no contract and outputs ${names.join(', ')}` : 'no contract and no outputs',
    remedy: 'write a contract: see docs/contract.md',
  };
}
