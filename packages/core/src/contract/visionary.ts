import type { OnnxHeader, OnnxTensor } from '../onnx/header.js';
import { ContractError } from './contract-error.js';
import type { Contract, InputBinding, VisionaryOutputs } from './contract.js';
import type { InferredContract } from './infer.js';
import { shapeFits } from './tensor-rules.js';

/**
 * Infers the contract of a file that was exported for Visionary; undefined for other files. The outputs are recognized by
 * name: `gauss…` [N,10], one with `color`, `rgb` or `sh` in its name, and optionally `num_points`. The camera looks along
 * +z with x left and y up, matrices are column-major, and time is a fraction of a cycle of 2.5 s.
 * @throws ContractError `contract/inference` with a fault for each input whose name is unknown.
 */
export function inferVisionary(header: OnnxHeader): InferredContract | undefined {
  const outputs = visionaryOutputs(header);
  if (outputs === undefined) return undefined;
  const inputs: Record<string, InputBinding> = {};
  const unknown: OnnxTensor[] = [];
  for (const input of header.inputs) {
    const binding = visionaryInput(input.name);
    if (binding) inputs[input.name] = binding;
    else unknown.push(input);
  }
  if (unknown.length > 0) {
    throw new ContractError(
      unknown.map(({ name }) => ({
        code: 'contract/inference',
        tensor: name,
        where: `input ${name}`,
        expected: "one of the inputs of Visionary's profile: a camera or view matrix, a projection, a time",
        found: 'another name and no contract',
        remedy: 'write a contract with the layout visionary: see docs/contract.md',
      })),
    );
  }
  const contract: Contract = {
    version: 1,
    inputs,
    outputs,
    ...(Object.values(inputs).some(({ role }) => role === 'time') ? { duration: VISIONARY_CYCLE_SECONDS } : {}),
  };
  const roles = Object.entries(inputs).map(([name, { role }]) => `input ${name} is ${role}`);
  return { contract, notes: ["names are those of Visionary's exporters", ...roles, describeOutputs(outputs)] };
}

/** Visionary plays 0.4 cycles per second. */
const VISIONARY_CYCLE_SECONDS = 2.5;

function visionaryOutputs({ outputs }: OnnxHeader): VisionaryOutputs | undefined {
  const gaussians = outputs.find(
    ({ name, dims }) =>
      /^gauss/i.test(name) && dims !== undefined && shapeFits(dims, { shapes: [['N', 10]], dtypes: [] }),
  );
  const color = outputs.find(({ name }) => name !== gaussians?.name && /color|sh|rgb/i.test(name));
  if (gaussians === undefined || color === undefined) return undefined;
  const columns = color.dims?.at(-1);
  const isPlain = columns === 4 || (columns === 3 && /rgb/i.test(color.name));
  return {
    layout: 'visionary',
    gaussians: gaussians.name,
    ...(isPlain ? { colors: color.name } : { sh: color.name }),
    ...(outputs.some(({ name }) => name === 'num_points') ? { count: 'num_points' } : {}),
  };
}

/**
 * Returns the binding of an input by its name; undefined if the name is unknown. An input `projection_matrix` gets the
 * projection; Visionary itself feeds it the camera, because it tests for `matrix` before `proj`.
 */
function visionaryInput(name: string): InputBinding | undefined {
  const lower = name.toLowerCase();
  if (lower.includes('proj')) return { role: 'projection', order: 'column-major', axes: 'LUF' };
  if (/camera|view|matrix/.test(lower)) return { role: 'view', order: 'column-major', axes: 'LUF' };
  return lower.includes('time') || lower === 't' ? { role: 'time', unit: 'normalized' } : undefined;
}

function describeOutputs({ gaussians, colors, sh, count }: VisionaryOutputs): string {
  const color = colors === undefined ? `harmonics ${sh}` : `colors ${colors}`;
  return `outputs are ${gaussians} and ${color}${count ? `, count ${count}` : ', no count'}`;
}
