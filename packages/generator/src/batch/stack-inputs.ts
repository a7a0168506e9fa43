import { hasInstances, type Contract } from '@gaussian-splat/core/contract';
import type { OnnxHeader } from '@gaussian-splat/core/onnx';
import { isOnGpu, sameInputs, type InputNumbers, type Inputs, type InputValue } from '../input-value.js';

/** Returns the names of the inputs with a row for each instance. */
export function inputsOfInstances({ inputs }: OnnxHeader, contract: Contract): ReadonlySet<string> {
  return new Set(inputs.filter((input) => hasInstances(input, contract)).map(({ name }) => name));
}

/** Returns the inputs that all instances of a run share: those that are not in `varying`. */
export function sharedInputs(inputs: Inputs, varying: ReadonlySet<string>): Inputs {
  return Object.fromEntries(Object.entries(inputs).filter(([name]) => !varying.has(name)));
}

/**
 * Groups instances that may run together: those with equal shared inputs, at most `max` per group, in the given order.
 * @param varying Names of the inputs with a row for each instance.
 */
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
 * Returns the inputs of one run of several instances.
 * @param instances Values from `bindInputs` for each instance, at least one, with equal shared inputs.
 * @param varying Names of the inputs that get a row for each instance; all others are those of the first instance.
 * @param count Number of rows. Beyond the instances, the last one is repeated, and its output is ignored.
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
