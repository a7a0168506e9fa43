import { hasInstances, type Contract } from '@gaussian-splat/core/contract';
import type { OnnxHeader } from '@gaussian-splat/core/onnx';
import { isOnGpu, sameInputs, type InputNumbers, type Inputs, type InputValue } from '../input-value.js';

/** Names of the inputs that have a row for each instance. */
export function inputsOfInstances({ inputs }: OnnxHeader, contract: Contract): ReadonlySet<string> {
  return new Set(inputs.filter((input) => hasInstances(input, contract)).map(({ name }) => name));
}

/** The inputs that all instances of a run share. */
export function sharedInputs(inputs: Inputs, varying: ReadonlySet<string>): Inputs {
  return Object.fromEntries(Object.entries(inputs).filter(([name]) => !varying.has(name)));
}

/** Groups instances that may run together: those with equal shared inputs, at most `most` of them, in order. */
export function groupInstances<T extends { readonly inputs: Inputs }>(
  instances: readonly T[],
  varying: ReadonlySet<string>,
  max: number,
): T[][] {
  const groups: { readonly shared: Inputs; readonly members: T[] }[] = [];
  for (const instance of instances) {
    const shared = sharedInputs(instance.inputs, varying);
    const group = groups.find((each) => each.members.length < max && sameInputs(each.shared, shared));
    if (group) group.members.push(instance);
    else groups.push({ shared, members: [instance] });
  }
  return groups.map(({ members }) => members);
}

/**
 * Stacks the inputs of several instances for one run.
 * @param instances Values from `bindInputs`, at least one set of them, with the same shared inputs.
 * @param varying Names of the inputs that get a row for each instance; all others are taken from the first.
 * @param count Number of rows: if it exceeds the instances, the last one is repeated, and its output is ignored.
 */
export function stackInputs(
  instances: readonly Inputs[],
  varying: ReadonlySet<string>,
  count = instances.length,
): Inputs {
  const rows = Array.from({ length: count }, (_, i) => instances[Math.min(i, instances.length - 1)]);
  const stacked = Object.entries(instances[0]).map(([name, value]): [string, InputValue] => {
    if (!varying.has(name) || isOnGpu(value)) return [name, value];
    return [name, stack(rows.map((row) => row[name] as InputNumbers))];
  });
  return Object.fromEntries(stacked);
}

function stack(rows: readonly InputNumbers[]): InputNumbers {
  const [{ dtype, dims, data: first }] = rows;
  const data = new (first.constructor as new (length: number) => typeof first)(rows.length * first.length);
  rows.forEach((row, i) => (data as Float32Array).set(row.data as Float32Array, i * first.length));
  return { dtype, dims: [rows.length, ...dims], data };
}
