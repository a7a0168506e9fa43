import { ContractError, type ContractFault } from '@gaussian-splat/core/contract';
import { constantOutputs, miscomputedConvolutions } from '@gaussian-splat/core/onnx';
import { isOnGpu, type GpuTensor, type Inputs, type InputValue } from '../input-value.js';
import type { Evidence } from '../proof/prove.js';
import { cadenceOf } from './cadence.js';
import { copyOf, evidenceOf, isEqual, readRun, type WrittenRun } from './first-run.js';
import { LiveSession, type FixedOutputs, type RunOutputs, type SessionKind } from './live-session.js';
import { loadRuntime, RuntimeGone } from './load-runtime.js';
import type { GeneratorModel } from './open-model.js';
import { TENSOR_USAGE } from './tensor-buffers.js';

export interface StartOptions {
  readonly model: GeneratorModel;
  readonly device: GPUDevice;
  /** Inputs of the warm-up. */
  readonly inputs: Inputs;
  /** Throws once nobody wants the session any more, or the device is lost: then there is nothing left to try. */
  readonly requireLife: () => void;
  /** The model has broken a copy of the runtime. */
  readonly onBreakage: () => void;
  /** The model runs, but on the CPU; the reason is for people. */
  readonly onFallback: (reason: string) => void;
  /** Why the GPU is not to be tried; undefined where it is. */
  readonly refusal?: string;
  /** Whether what the first run wrote on the GPU is to be kept for a comparison. */
  readonly keepsEvidence?: boolean;
  /**
   * Takes the outputs of the first run: they answer the request that starts the session, before any run that serves the recording. It must submit its work
   * before it returns, and must not throw. It is called again only if a later start replaces the first one.
   */
  readonly onFirstRun?: (outputs: RunOutputs) => void;
}

/** A session that has run, and what its first run on the GPU wrote, if that is to be compared. */
export interface StartedSession {
  readonly session: LiveSession;
  readonly evidence?: Evidence;
}

/**
 * A session that has run, so that everything is compiled: with its GPU commands recorded where model and runtime allow, else with
 * commands made for every run, else on the CPU.
 * @throws ContractError `contract/run` if the model runs nowhere; GaussianSplatError `network/*` if the runtime cannot be had; RuntimeGone if
 * another model has broken the runtime meanwhile; what `requireLife` throws.
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
    // Who listens asks anew for what the GPU may have written wrongly: this run answers that.
    onFallback(reason);
    options.onFirstRun?.(outputs);
  });
  if (started === undefined) throw new ContractError([runFault(model, refusals.join('; '))]);
  return { session: started.session };
}

/**
 * Recorded commands must write what commands made anew write, for other inputs than those that they were recorded with, too. Only
 * kernels are recorded: a result in another shape is copied in the first run and then no more. Outputs that are constants are not asked for
 * again: what the first run wrote of them stays.
 */
async function startOnGpu(options: StartOptions, refusals: string[]): Promise<StartedSession | undefined> {
  const { model, device, keepsEvidence } = options;
  // The proof of a recording takes four runs, which a model that runs for each choice of a person does not earn back.
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
  let session: LiveSession | undefined;
  try {
    session = await startRecorded(options, plain, { ...options, inputs: others.inputs }, refusals, fixed);
  } finally {
    for (const buffer of others.buffers) buffer.destroy();
    if (session?.kind !== 'captured') for (const { buffer } of Object.values(fixed)) buffer.destroy();
  }
  return session && { session, evidence };
}

/** @param changed the same with other inputs */
async function startRecorded(
  options: StartOptions,
  plain: Started,
  changed: StartOptions,
  refusals: string[],
  fixed: FixedOutputs,
): Promise<LiveSession | undefined> {
  const expected = await attempt(plain.session, changed, []);
  if (expected === undefined) {
    await plain.session.release();
    return (await start('webgpu', options, refusals))?.session;
  }
  // One at a time: both would hold the weights.
  await plain.session.release();
  const recorded = await start('captured', options, [], undefined, fixed);
  if (recorded && isEqual(recorded.written, plain.written)) {
    const replayed = await attempt(recorded.session, changed, []);
    if (replayed && isEqual(replayed, expected)) return recorded.session;
  }
  await recorded?.session.release();
  return (await start('webgpu', options, refusals))?.session;
}

/** A fault of the runtime, in our words. */
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

/** Commands can be recorded only for fixed shapes and with all inputs on the GPU, where there are no 64-bit integers. */
function canBeRecorded({ header }: GeneratorModel): boolean {
  const isFixed = [...header.inputs, ...header.outputs].every(({ dims }) =>
    dims?.every((dim) => typeof dim === 'number'),
  );
  return isFixed && header.inputs.every(({ dtype }) => dtype !== 'int64');
}

/** What {@link otherInputs} gives. */
interface OtherInputs {
  readonly inputs: Inputs;
  /** To be destroyed once nothing runs with them any more. */
  readonly buffers: readonly GPUBuffer[];
}

/** Inputs that are not those given, pictures and Gaussians on the GPU included. Whether a model likes them does not matter: two runs are compared. */
function otherInputs({ device, inputs }: StartOptions): OtherInputs {
  const buffers: GPUBuffer[] = [];
  const changed = Object.entries(inputs).map(([name, value]): [string, InputValue] => {
    if (isOnGpu(value)) {
      const buffer = filled(device, value);
      buffers.push(buffer);
      return [name, { ...value, buffer }];
    }
    if (value.dtype === 'float32') return [name, { ...value, data: numbers(value.data).map((x) => 0.75 * x + 0.125) }];
    // Indices: of all others these are most likely to be within what they point into.
    if (value.dtype === 'int32') return [name, { ...value, data: numbers(value.data).map((x) => (x === 0 ? 1 : 0)) }];
    return [name, value];
  });
  return { inputs: Object.fromEntries(changed), buffers };
}

const numbers = (data: unknown): Float32Array | Int32Array => data as Float32Array | Int32Array;

/** What no picture and no Gaussians hold in every place: 0.25 as float32, and twice as float16. A count of rows is none. */
const QUARTERS = { float32: 0x3e80_0000, float16: 0x3400_3400, int32: 0 } as const;

/** A buffer as that of a tensor, with one number in every place. */
function filled(device: GPUDevice, { buffer, dtype }: GpuTensor): GPUBuffer {
  const size = Math.ceil(buffer.size / 4) * 4;
  const other = device.createBuffer({ label: 'gs.generator.other', size, usage: TENSOR_USAGE, mappedAtCreation: true });
  new Uint32Array(other.getMappedRange()).fill(QUARTERS[dtype]);
  other.unmap();
  return other;
}

interface Started {
  readonly session: LiveSession;
  /** What its first run wrote. */
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
  let session: LiveSession;
  try {
    session = await LiveSession.create(kind, runtime, model, device, fixed);
  } catch (error) {
    if (error instanceof RuntimeGone) throw error;
    refusals.push(`${kind}: ${messageOf(error)}`);
    return undefined;
  }
  const written = await attempt(session, options, refusals, onOutputs);
  if (written) return { session, written };
  await session.release();
  // Whatever broke the runtime would do so again: on the CPU, for one, what does not end would stop the page.
  if (runtime.isBroken) {
    options.onBreakage();
    throw new ContractError([runFault(model, refusals.join('; '))]);
  }
  return undefined;
}

/** One run, and pieces of what it wrote; undefined if it fails. @throws RuntimeGone, and then the session is released. */
async function attempt(
  session: LiveSession,
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
