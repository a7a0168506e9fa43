/** Exports for the page of the checker, without dependencies on Node. */
import { ContractError, type ContractFault } from '@gaussian-splat/core/contract';
import {
  compareOutputs,
  GeneratorSession,
  isDifferent,
  readTensors,
  type OutputDifference,
  type GeneratorModel,
  type Inputs,
} from '@gaussian-splat/generator';
import type { Outputs, SampleInputs } from './run-instances.js';
import { runModel, type RunReport, type Runtime } from './run-samples.js';

export interface PageRun extends RunReport {
  /** Kind of the session on the page's GPU, and the reasons for a fallback, in English for display. */
  readonly how: string;
}

const HOW = {
  captured: 'on the GPU, with its commands recorded',
  webgpu: 'on the GPU, with commands encoded again for every run',
  wasm: 'on the CPU',
} as const;

/**
 * Runs a model as `gaussian-splat check --run` does, and each sample also on a GPU device, as pages do. The report
 * contains the differences.
 * @param ort ONNX Runtime for the CPU; its sessions run one after the other.
 */
export async function runInPage(model: GeneratorModel, device: GPUDevice, ort: Runtime): Promise<PageRun> {
  const reasons: string[] = [];
  // The session does not compare the results itself, because this function compares each sample.
  const whole = new GeneratorSession(model, device, (reason) => reasons.push(reason), false);
  const session = model.contract.instances === undefined ? whole : whole.forInstances(1);
  try {
    const report = await runModel(ort, model, model.header, model.contract, async (inputs, expected) => {
      try {
        return verdictOf(model, expected, await runOnGpu(session, inputs));
      } catch (error) {
        if (!(error instanceof ContractError)) throw error;
        return { cell: 'does not run here', faults: error.faults };
      }
    });
    const how = session.kind === undefined ? 'nowhere' : HOW[session.kind];
    return { ...report, how: [`In a page it runs ${how}`, ...reasons].join(': ') };
  } finally {
    await session.release();
  }
}

interface GpuRun {
  readonly bytes: Readonly<Record<string, Uint8Array>>;
  readonly dims: Readonly<Record<string, readonly number[]>>;
}

async function runOnGpu(session: GeneratorSession, inputs: SampleInputs): Promise<GpuRun> {
  const { model, device } = session;
  let reading: Promise<Uint8Array[]> | undefined;
  let shapes: GpuRun['dims'] = {};
  await session.run(inputs as unknown as Inputs, ({ tensors, dims }) => {
    shapes = dims;
    const parts = model.outputs.map(({ name, dtype }) => ({
      buffer: tensors[name],
      size: Math.ceil((dims[name].reduce((product, dim) => product * dim, 1) * WIDTHS[dtype]) / 4) * 4,
    }));
    reading = readTensors(device, parts);
  });
  const read = (await reading) ?? [];
  return { dims: shapes, bytes: Object.fromEntries(model.outputs.map(({ name }, i) => [name, read[i]])) };
}

const WIDTHS = { float32: 4, float16: 2, int32: 4, int64: 8 } as const;

function verdictOf({ outputs, layout }: GeneratorModel, expected: Outputs, { bytes, dims }: GpuRun) {
  const other = outputs.find(({ name }) => String(dims[name]) !== String(expected[name].dims));
  if (other !== undefined) {
    const [found, rows] = [String(dims[other.name]), String(expected[other.name].dims)];
    return { cell: `${other.name} [${found}] on the GPU`, faults: [differs(other.name, `[${rows}]`, `[${found}]`)] };
  }
  const parts = outputs.map(({ name, dtype }): OutputDifference => {
    const { buffer, byteOffset, byteLength } = expected[name].data as unknown as Uint8Array;
    return {
      tensor: name,
      dtype: dtype === 'int64' ? 'int32' : dtype,
      start: 0,
      found: bytes[name].subarray(0, byteLength),
      expected: new Uint8Array(buffer, byteOffset, byteLength),
    };
  });
  const comparison = compareOutputs(parts, layout?.attributes);
  const figure = `${comparison.where} differ by up to ${comparison.error.toPrecision(2)} of the largest on the GPU`;
  const faults = isDifferent(comparison) ? [differs(comparison.where, 'the numbers of the CPU', figure)] : [];
  return { cell: comparison.error === 0 ? 'the same on the GPU' : figure, faults };
}

const differs = (tensor: string, expected: string, found: string): ContractFault => ({
  code: 'contract/run',
  tensor,
  where: 'the run on the GPU',
  expected,
  found,
  remedy:
    'pages detect this, and run this model on the CPU; `gaussian-export check` names the operators that the GPU computes wrongly',
});

export type { Runtime };
