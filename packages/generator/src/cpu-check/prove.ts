import { loadRuntime } from '../runtime/load-runtime.js';
import type { GeneratorModel } from '../runtime/open-model.js';
import { compareOutputs, isDifferent, type OutputDifference, type Comparison } from './compare.js';
import { readRecord, recordKey, writeRecord, type CpuCheckResult } from './record.js';
import { runInWorker, type CpuRun, type StartWorker } from './run-on-cpu.js';

/** Inputs of a run on the GPU, and ranges of its output. */
export interface Evidence {
  readonly feeds: CpuRun['feeds'];
  readonly dims: Readonly<Record<string, readonly number[]>>;
  readonly parts: readonly (CpuRun['parts'][number] & {
    readonly dtype: OutputDifference['dtype'];
    readonly bytes: Uint8Array;
  })[];
}

/** Maximum bytes of weights and outputs of a model that is compared, because a worker holds a second copy. */
const MAX_BYTES = 512 * 2 ** 20;

/** Operators whose outputs are random and cannot be compared. */
const IS_RANDOM = /^(Random|Bernoulli|Multinomial)/;

interface Known {
  readonly key: Promise<string | undefined>;
  verdict: Promise<CpuCheckResult> | undefined;
}

/** Results by the bytes of a model, because its sessions for other numbers of instances run the same computation. */
const known = new WeakMap<GPUDevice, WeakMap<Uint8Array, Known>>();

function knownOf(model: GeneratorModel, device: GPUDevice): Known {
  const models = known.get(device) ?? new WeakMap<Uint8Array, Known>();
  known.set(device, models);
  let entry = models.get(model.bytes);
  if (entry === undefined) {
    entry = { key: recordKey(model, device).catch(() => undefined), verdict: undefined };
    models.set(model.bytes, entry);
  }
  return entry;
}

/** Returns the result of an earlier visit or session; undefined if there is none. */
export async function earlierVerdict(model: GeneratorModel, device: GPUDevice): Promise<CpuCheckResult | undefined> {
  const entry = knownOf(model, device);
  const kept = readRecord(await entry.key);
  if (kept !== undefined) entry.verdict ??= Promise.resolve(kept);
  return kept;
}

/**
 * Compares the output of a model's first run on the GPU with that of the same run on the CPU. Waits until the page is
 * idle, and runs the model in a worker. Never rejects.
 */
export async function prove(
  model: GeneratorModel,
  device: GPUDevice,
  evidence: Evidence,
  signal: AbortSignal,
  startWorker?: StartWorker,
): Promise<CpuCheckResult> {
  const entry = knownOf(model, device);
  let own: Promise<CpuCheckResult> | undefined;
  for (;;) {
    const comparing = (entry.verdict ??= own = compareAndRecord(entry, model, evidence, signal, startWorker));
    try {
      return await comparing;
    } catch (error) {
      if (entry.verdict === comparing) entry.verdict = undefined;
      // The comparison of another session ends with that session, and this one starts its own.
      if (comparing !== own && !signal.aborted) continue;
      const reason = `not compared with the CPU: ${error instanceof Error ? error.message : String(error)}`;
      return { result: 'unknown', reason };
    }
  }
}

async function compareAndRecord({ key }: Known, ...given: Parameters<typeof compare>): Promise<CpuCheckResult> {
  const verdict = await compare(...given);
  writeRecord(await key, verdict);
  return verdict;
}

async function compare(
  model: GeneratorModel,
  evidence: Evidence,
  signal: AbortSignal,
  startWorker?: StartWorker,
): Promise<CpuCheckResult> {
  const { header, contract, instances, layout } = model;
  const unknown = (why: string): CpuCheckResult => ({ result: 'unknown', reason: `not compared with the CPU: ${why}` });
  if ([...header.operators.keys()].some((name) => IS_RANDOM.test(name))) return unknown('it draws random numbers');
  if (bytesOf(model) > MAX_BYTES) return unknown(`it takes more than ${MAX_BYTES} bytes`);
  // Such a run says nothing about the GPU, so no result is recorded.
  if (evidence.parts.every(({ size, tensor }) => size === 0 || tensor === layout?.count))
    throw new Error('its first run wrote no rows');
  await idle();
  signal.throwIfAborted();
  const runtime = await loadRuntime();
  const { feeds, parts } = evidence;
  const outputs = await runInWorker(
    runtime.source,
    {
      model: model.bytes,
      externalData: model.externalData,
      freeDimensionOverrides: instances === undefined ? undefined : { [contract.instances!.axis]: instances },
      feeds,
      parts: parts.map(({ tensor, offset, size }) => ({ tensor, offset, size })),
    },
    signal,
    startWorker,
  );
  for (const [name, dims] of Object.entries(outputs.dims)) {
    // A different number of rows is the effect of a threshold and not an error, but such rows cannot be compared.
    if (String(dims) !== String(evidence.dims[name]))
      return unknown(`it writes ${String(dims)} there, not ${String(evidence.dims[name])}`);
  }
  const compared = parts.map(({ tensor, dtype, offset, bytes }, i): OutputDifference => {
    const start = offset / (dtype === 'float16' ? 2 : 4);
    return { tensor, dtype, start, found: bytes, expected: outputs.parts[i] };
  });
  return verdictOf(compareOutputs(compared, model.layout?.attributes));
}

function verdictOf(comparison: Comparison): CpuCheckResult {
  const { error, where, share } = comparison;
  const figure = `${where} differ by up to ${error.toPrecision(2)} of the largest`;
  if (!isDifferent(comparison)) return { result: 'same', error, reason: `as on the CPU: ${figure}` };
  const percent = (100 * share).toPrecision(2);
  return {
    result: 'different',
    error,
    reason: `webgpu: computes other numbers than the CPU: ${figure}, ${percent} % of them by more than is rounding`,
  };
}

function bytesOf({ bytes, externalData, outputs }: GeneratorModel): number {
  const weights = externalData.reduce((sum, { data }) => sum + data.length, bytes.length);
  return outputs.reduce((sum, { max = 0, dtype }) => sum + max * (dtype === 'float16' ? 2 : 4), weights);
}

/** Waits until the page is idle, at most two seconds; 500 ms in browsers without `requestIdleCallback`. */
function idle(): Promise<unknown> {
  return new Promise((resolve) => {
    if (typeof requestIdleCallback === 'function') requestIdleCallback(resolve, { timeout: 2000 });
    else setTimeout(resolve, 500);
  });
}
