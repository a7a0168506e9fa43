import { ContractError, type ContractFault } from '@gaussian-splat/core/contract';
import { constantOutputs, miscomputedConvolutions } from '@gaussian-splat/core/onnx';
import { isOnGpu, type GpuTensor, type Inputs, type InputValue } from '../input-value.js';
import type { Evidence } from '../proof/prove.js';
import { cadenceOf } from './cadence.js';
import { copyOf, evidenceOf, isEqual, readRun, type WrittenRun } from './first-run.js';
import { OrtSession, type FixedOutputs, type RunOutputs, type SessionKind } from './ort-session.js';
import { loadRuntime, RuntimeGone } from './load-runtime.js';
import type { GeneratorModel } from './open-model.js';
import { TENSOR_USAGE } from './tensor-buffers.js';

export interface StartOptions {
  readonly model: GeneratorModel;
  readonly device: GPUDevice;
  /** Inputs of the warm-up. */
  readonly inputs: Inputs;
  /** Throws once the session is not needed any more, or the device is lost: then further attempts are pointless. */
  readonly requireLife: () => void;
  /** Called when the model has broken a copy of the runtime. */
  readonly onBreakage: () => void;
  /** Called when the model runs on the CPU, with the reason for display. */
  readonly onFallback: (reason: string) => void;
  /** Reason that the GPU must not be tried; undefined to try it. */
  readonly refusal?: string;
  /** Whether to keep the output of the first run on the GPU for a comparison. */
  readonly keepsEvidence?: boolean;
  /**
   * Called with the outputs of the first run: they serve the request that starts the session, before any run for graph
   * capture. It must submit its work before it returns, and must not throw. It is called again only if a later start
   * replaces the first one.
   */
  readonly onFirstRun?: (outputs: RunOutputs) => void;
}

/** A session that has run, and the output of its first run on the GPU, if that is to be compared. */
export interface StartedSession {
  readonly session: OrtSession;
  readonly evidence?: Evidence;
}

/**
 * Starts a session and runs it once, so that everything is compiled: with graph capture if model and runtime allow it,
 * else with commands encoded for every run, else on the CPU.
 * @throws ContractError `contract/run` if the model does not run; GaussianSplatError `network/*` if the runtime is
 * unavailable; RuntimeGone if another model has broken the runtime meanwhile; errors of `requireLife`.
 */
export async function startSession(options: StartOptions): Promise<StartedSession> {
  const { model, device, onFallback, refusal } = options;
  const refusals: string[] = [];
  if (refusal !== undefined) {
    refusals.push(refusal);
  } else if (isHalfWithoutFeature(model, device)) {
    refusals.push('webgpu: its float16 tensors need the device feature shader-f16, which this device does not have');
  } else if (miscomputedConvolutions(model.header).length > 0) {
    refusals.push(convolutionReason(model));
  } else {
    const started = await startOnGpu(options, refusals);
    if (started) return started;
  }
  const reason = refusals.join('; ');
  const started = await start('wasm', options, refusals, (outputs) => {
    // Listeners request results again that the GPU may have computed wrongly: this run serves that request.
    onFallback(reason);
    options.onFirstRun?.(outputs);
  });
  if (started === undefined) throw new ContractError([runFault(model, refusals.join('; '))]);
  return { session: started.session };
}

/**
 * Captured commands must write the same results as encoded ones, also for other inputs than those of the capture. Only
 * kernels are captured: a reshaped result is copied in the first run and then never again. Outputs that are constants
 * are kept from the first run.
 */
async function startOnGpu(options: StartOptions, refusals: string[]): Promise<StartedSession | undefined> {
  const { model, device, keepsEvidence } = options;
  // Verifying a capture takes four runs, which do not pay off for a model that runs only when a visitor selects another
  // input.
  const isRecordable = canBeRecorded(model) && cadenceOf(model) === 'continuous';
  const constants = isRecordable ? constantOutputs(model.header) : new Set<string>();
  const fixed: FixedOutputs = {};
  const plain = await start('webgpu', options, refusals, (outputs) => {
    options.onFirstRun?.(outputs);
    for (const { name } of model.outputs) if (constants.has(name)) fixed[name] = copyOf(device, name, outputs);
  });
  if (plain === undefined) return undefined;
  const evidence = keepsEvidence ? await evidenceOf(device, options.inputs, plain.written) : undefined;
  if (!isRecordable) return { session: plain.session, evidence };
  const others = otherInputs(options);
  let session: OrtSession | undefined;
  try {
    session = await startRecorded(options, plain, { ...options, inputs: others.inputs }, refusals, fixed);
  } finally {
    for (const buffer of others.buffers) buffer.destroy();
    if (session?.kind !== 'captured') for (const { buffer } of Object.values(fixed)) buffer.destroy();
  }
  return session && { session, evidence };
}

/** @param changed The same with other inputs. */
async function startRecorded(
  options: StartOptions,
  plain: Started,
  changed: StartOptions,
  refusals: string[],
  fixed: FixedOutputs,
): Promise<OrtSession | undefined> {
  const expected = await attempt(plain.session, changed, []);
  if (expected === undefined) {
    await plain.session.release();
    return (await start('webgpu', options, refusals))?.session;
  }
  // One after the other, because both hold the weights.
  await plain.session.release();
  const recorded = await start('captured', options, [], undefined, fixed);
  if (recorded && isEqual(recorded.written, plain.written)) {
    const replayed = await attempt(recorded.session, changed, []);
    if (replayed && isEqual(replayed, expected)) return recorded.session;
  }
  await recorded?.session.release();
  return (await start('webgpu', options, refusals))?.session;
}

/** Describes a fault of the runtime. */
export function runFault({ header }: GeneratorModel, found: string): ContractFault {
  return {
    code: 'contract/run',
    where: header.name,
    expected: 'a model that ONNX Runtime runs',
    found: found.slice(0, 1000),
    remedy: 'run it in a shell (gaussian-splat check MODEL --run), and mend or simplify what the runtime refuses',
  };
}

function convolutionReason({ header }: GeneratorModel): string {
  const [{ inputs, outputs }] = miscomputedConvolutions(header);
  return `webgpu: ONNX Runtime computes a convolution of ${inputs} channels to ${outputs} wrongly there; pad the channels going in to a multiple of 4`;
}

function isHalfWithoutFeature({ header, outputs }: GeneratorModel, device: GPUDevice): boolean {
  const isHalf = [...outputs, ...header.inputs].some(({ dtype }) => dtype === 'float16');
  return isHalf && !device.features.has('shader-f16');
}

/** Graph capture requires fixed shapes and all inputs on the GPU, which has no 64-bit integers. */
function canBeRecorded({ header }: GeneratorModel): boolean {
  const isFixed = [...header.inputs, ...header.outputs].every(({ dims }) =>
    dims?.every((dim) => typeof dim === 'number'),
  );
  return isFixed && header.inputs.every(({ dtype }) => dtype !== 'int64');
}

/** Result of {@link otherInputs}. */
interface OtherInputs {
  readonly inputs: Inputs;
  /** To be destroyed once no run uses them any more. */
  readonly buffers: readonly GPUBuffer[];
}

/**
 * Inputs that differ from the given ones, including images and Gaussians on the GPU. They need not be meaningful to the
 * model, because two runs are compared.
 */
function otherInputs({ device, inputs }: StartOptions): OtherInputs {
  const buffers: GPUBuffer[] = [];
  const changed = Object.entries(inputs).map(([name, value]): [string, InputValue] => {
    if (isOnGpu(value)) {
      const buffer = filled(device, value);
      buffers.push(buffer);
      return [name, { ...value, buffer }];
    }
    if (value.dtype === 'float32') return [name, { ...value, data: numbers(value.data).map((x) => 0.75 * x + 0.125) }];
    // 0 and 1 are the integers most likely to be valid as indices.
    if (value.dtype === 'int32') return [name, { ...value, data: numbers(value.data).map((x) => (x === 0 ? 1 : 0)) }];
    return [name, value];
  });
  return { inputs: Object.fromEntries(changed), buffers };
}

const numbers = (data: unknown): Float32Array | Int32Array => data as Float32Array | Int32Array;

/**
 * A bit pattern that no image and no Gaussians contain everywhere: 0.25 as float32, and twice as float16. Counts of
 * rows keep 0.
 */
const QUARTERS = { float32: 0x3e80_0000, float16: 0x3400_3400, int32: 0 } as const;

/** A buffer of the same size, filled with one number. */
function filled(device: GPUDevice, { buffer, dtype }: GpuTensor): GPUBuffer {
  const size = Math.ceil(buffer.size / 4) * 4;
  const other = device.createBuffer({ label: 'gs.generator.other', size, usage: TENSOR_USAGE, mappedAtCreation: true });
  new Uint32Array(other.getMappedRange()).fill(QUARTERS[dtype]);
  other.unmap();
  return other;
}

interface Started {
  readonly session: OrtSession;
  /** Output of its first run. */
  readonly written: WrittenRun;
}

async function start(
  kind: SessionKind,
  options: StartOptions,
  refusals: string[],
  onOutputs?: (outputs: RunOutputs) => void,
  fixed?: FixedOutputs,
): Promise<Started | undefined> {
  const { model, device, requireLife } = options;
  requireLife();
  const runtime = await loadRuntime();
  let session: OrtSession;
  try {
    session = await OrtSession.create(kind, runtime, model, device, fixed);
  } catch (error) {
    if (error instanceof RuntimeGone) throw error;
    refusals.push(`${kind}: ${messageOf(error)}`);
    return undefined;
  }
  const written = await attempt(session, options, refusals, onOutputs);
  if (written) return { session, written };
  await session.release();
  // A model that broke the runtime would do so again; on the CPU a run without end would block the page.
  if (runtime.isBroken) {
    options.onBreakage();
    throw new ContractError([runFault(model, refusals.join('; '))]);
  }
  return undefined;
}

/** One run, and ranges of its output; undefined if it fails. @throws RuntimeGone, after releasing the session. */
async function attempt(
  session: OrtSession,
  { device, inputs, model }: StartOptions,
  refusals: string[],
  onOutputs?: (outputs: RunOutputs) => void,
): Promise<WrittenRun | undefined> {
  let reading: Promise<WrittenRun> | undefined;
  try {
    await session.run(inputs, (outputs) => {
      reading = readRun(device, model, outputs);
      onOutputs?.(outputs);
    });
    return await reading;
  } catch (error) {
    if (error instanceof RuntimeGone) {
      await session.release();
      throw error;
    }
    refusals.push(`${session.kind}: ${messageOf(error)}`);
    return undefined;
  }
}

const messageOf = (error: unknown): string => (error instanceof Error ? error.message : String(error));
