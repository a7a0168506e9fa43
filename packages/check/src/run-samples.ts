import {
  checkBounds,
  checkOutputs,
  compareRuns,
  type Contract,
  type ContractFault,
} from '@gaussian-splat/core/contract';
import type { OnnxHeader } from '@gaussian-splat/core/onnx';
import type * as OnnxRuntime from 'onnxruntime-web';
import type { InferenceSession, Tensor } from 'onnxruntime-web';
import { compareTogether, runAlone, stacked, type Outputs, type SampleInputs } from './run-instances.js';
import { sampleInputs, type Sample } from './sample-inputs.js';

export type Runtime = typeof OnnxRuntime;

/** Bytes of a model and of its external files. */
export interface ModelFiles {
  readonly bytes: Uint8Array;
  readonly externalData: readonly { readonly path: string; readonly data: Uint8Array }[];
}

export interface RunReport {
  readonly faults: readonly ContractFault[];
  /**
   * One row of text for each run: the label of its inputs, the number of valid rows, the box of the centers,
   * milliseconds, and the result of {@link Compare} if there is one.
   */
  readonly rows: readonly (readonly string[])[];
}

/**
 * Runs the model on another backend with inputs whose outputs on the CPU are `expected`. Returns a text for the table
 * and the faults.
 */
export type Compare = (
  inputs: SampleInputs,
  expected: Outputs,
) => Promise<{ readonly cell: string; readonly faults: readonly ContractFault[] }>;

/**
 * Runs a model on the CPU with inputs at the limits that its contract declares, and checks every value of its output.
 * Gives the same results in Node and in browsers.
 * @param header Header of a model that satisfies the contract.
 * @param compare Runs each sample on another backend, too.
 */
export async function runModel(
  ort: Runtime,
  files: ModelFiles,
  header: OnnxHeader,
  contract: Contract,
  compare?: Compare,
): Promise<RunReport> {
  const samples = sampleInputs(header, contract);
  let session: InferenceSession | undefined;
  try {
    session = await createSession(ort, files);
    const feed = (inputs: SampleInputs): Promise<Outputs> => run(ort, session!, inputs);
    const { instances } = contract;
    if (instances === undefined) return await runSamples(feed, contract, samples, compare);
    const alone = (inputs: SampleInputs): Promise<Outputs> => runAlone(feed, header, contract, inputs);
    const together: Compare | undefined =
      compare &&
      (async (inputs) => {
        const one = stacked([inputs], header, contract);
        return compare(one, await feed(one));
      });
    const report = await runSamples(alone, contract, samples, together);
    const faults = await compareTogether(feed, header, contract, samples);
    return { ...report, faults: [...report.faults, ...faults] };
  } catch (error) {
    return { faults: [runFault(session === undefined ? 'loading' : 'running', error)], rows: [] };
  } finally {
    await session?.release();
  }
}

async function createSession(ort: Runtime, { bytes, externalData }: ModelFiles): Promise<InferenceSession> {
  return ort.InferenceSession.create(bytes, {
    executionProviders: ['wasm'],
    // The optimization level excludes fusions, because some of them compute wrong results.
    graphOptimizationLevel: 'basic',
    logSeverityLevel: 3,
    externalData: externalData.map(({ path, data }) => ({ path, data })),
  });
}

async function runSamples(
  feed: (inputs: SampleInputs) => Promise<Outputs>,
  contract: Contract,
  samples: readonly Sample[],
  compare?: Compare,
): Promise<RunReport> {
  const faults = new Map<string, ContractFault>();
  const keep = (label: string, found: readonly ContractFault[]): void => {
    for (const fault of found) {
      // A fault usually occurs in every run, mostly in other rows. Only its first occurrence is reported.
      const key = `${fault.code} ${fault.where.replace(/ of row \d+$/, '')}`;
      if (!faults.has(key)) faults.set(key, { ...fault, where: `${fault.where} (run with ${label})` });
    }
  };
  const rows: string[][] = [];
  for (const [i, { label, isDefault, inputs }] of samples.entries()) {
    const start = performance.now();
    const outputs = await feed(inputs);
    const milliseconds = performance.now() - start;
    const report = checkOutputs(contract, outputs);
    const { rows: count, live, bounds } = report;
    keep(label, report.faults);
    if (isDefault) keep(label, checkBounds(contract, report));
    if (i === 0) keep(label, compareRuns(contract, outputs, await feed(inputs)));
    const compared = await compare?.(inputs, outputs);
    keep(label, compared?.faults ?? []);
    const cells = [`${milliseconds.toFixed(1)} ms`, ...(compared ? [compared.cell] : [])];
    if (contract.outputs.layout === 'image') {
      rows.push([label, `[${outputs[contract.outputs.image]?.dims.join(', ')}]`, 'an image', ...cells]);
      continue;
    }
    const box = bounds ? `${bounds.min.map(short).join(' ')} to ${bounds.max.map(short).join(' ')}` : 'no centers';
    rows.push([label, count === live ? `${live} rows` : `${live} of ${count} rows`, box, ...cells]);
  }
  return { faults: [...faults.values()], rows };
}

const short = (value: number): string => String(Number(value.toPrecision(4)));

async function run(ort: Runtime, session: InferenceSession, inputs: SampleInputs): Promise<Outputs> {
  const feeds: Record<string, Tensor> = {};
  for (const [name, { dtype, data, dims }] of Object.entries(inputs)) {
    feeds[name] = new ort.Tensor(dtype as 'float32', data as Float32Array, dims);
  }
  const results = await session.run(feeds);
  const outputs: Outputs = {};
  for (const [name, { type, dims, data }] of Object.entries(results)) {
    outputs[name] = { dtype: type, dims, data: data as Float32Array };
  }
  return outputs;
}

function runFault(doing: string, error: unknown): ContractFault {
  const message = error instanceof Error ? error.message : String(error);
  return {
    code: 'contract/run',
    where: `${doing} the model with ONNX Runtime on the CPU`,
    expected: 'no error',
    found: message.replace(/\s+/g, ' ').slice(0, 400),
    remedy: 'run it with onnxruntime in Python, whose messages are longer, and correct the export',
  };
}
