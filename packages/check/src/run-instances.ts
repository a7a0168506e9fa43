import { halfToNumber } from '@gaussian-splat/core';
import {
  outputsOfInstance,
  tensorNames,
  type Contract,
  type ContractFault,
  type OutputTensor,
} from '@gaussian-splat/core/contract';
import type { OnnxHeader } from '@gaussian-splat/core/onnx';
import { groupInstances, inputsOfInstances, stackInputs, type Inputs } from '@gaussian-splat/generator';
import type { Sample } from './sample-inputs.js';

export type SampleInputs = Sample['inputs'];
/** Outputs of a run by output name. */
export type Outputs = Record<string, OutputTensor>;
type Feed = (inputs: SampleInputs) => Promise<Outputs>;

/** Tolerance for another order of summation, by element type, as a fraction of the largest number of a tensor. */
const ROUNDING = { float32: 1e-5, float16: 2e-3 } as const;

/** Runs one instance of a model that takes several. Returns outputs in the format of a model without instances. */
export async function runAlone(
  feed: Feed,
  header: OnnxHeader,
  contract: Contract,
  inputs: SampleInputs,
): Promise<Outputs> {
  return outputsOfInstance(await feed(stacked([inputs], header, contract)), 0);
}

/**
 * Checks that instances give the same outputs in one run as in separate runs, because no instance may depend on others.
 * Returns the faults.
 */
export async function compareTogether(
  feed: Feed,
  header: OnnxHeader,
  contract: Contract,
  samples: readonly Sample[],
): Promise<ContractFault[]> {
  const varying = inputsOfInstances(header, contract);
  const members = samples.map(({ label, inputs }) => ({ label, inputs: inputs as unknown as Inputs }));
  for (const group of groupInstances(members, varying, contract.instances!.most)) {
    if (group.length < 2) continue;
    const inputs = group.map((member) => member.inputs as unknown as SampleInputs);
    const together = await feed(stacked(inputs, header, contract));
    for (const [i, { label }] of group.entries()) {
      const found = outputsOfInstance(together, i);
      const expected = await runAlone(feed, header, contract, inputs[i]);
      const names = tensorNames(contract.outputs).map(([, output]) => output);
      const name = names.find((output) => differs(found[output], expected[output]));
      if (name !== undefined) return [otherTogether(name, label, group.length)];
    }
  }
  return [];
}

/** Returns the inputs of one run of several instances. */
export const stacked = (inputs: readonly SampleInputs[], header: OnnxHeader, contract: Contract): SampleInputs =>
  stackInputs(inputs as unknown as Inputs[], inputsOfInstances(header, contract)) as unknown as SampleInputs;

function differs(found: OutputTensor, { dtype, data }: OutputTensor): boolean {
  const isBits = dtype === 'float16' && data instanceof Uint16Array;
  const numberAt = (values: ArrayLike<number>, i: number): number =>
    isBits ? halfToNumber(values[i]) : Number(values[i]);
  let largest = 0;
  for (let i = 0; i < data.length; i++) largest = Math.max(largest, Math.abs(numberAt(data, i)));
  const slack = largest * (dtype === 'float16' ? ROUNDING.float16 : ROUNDING.float32);
  // The negated comparison counts a NaN as different from everything.
  for (let i = 0; i < data.length; i++)
    if (!(Math.abs(numberAt(found.data, i) - numberAt(data, i)) <= slack)) return true;
  return false;
}

const otherTogether = (name: string, label: string, count: number): ContractFault => ({
  code: 'contract/instances',
  tensor: name,
  where: `output ${name} (run with ${label})`,
  expected: 'the values that this instance writes in a separate run',
  found: `other values in a run of ${count} instances`,
  remedy: 'keep the axis of the instances apart in every operation: no sum, mean or softmax may run along it',
});
