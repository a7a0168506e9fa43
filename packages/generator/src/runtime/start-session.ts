import { ContractError, type ContractFault } from '@gaussian-splat/core/contract';
import { constantOutputs, miscomputedNodes } from '@gaussian-splat/core/onnx';
import { elementsOf, isOnGpu, type GpuTensor, type Inputs, type InputValue } from '../input-value.js';
import type { Evidence } from '../cpu-check/prove.js';
import { cadenceOf } from './cadence.js';
import { copyOf, evidenceOf, isEqual, readRun, type WrittenRun } from './first-run.js';
import { OrtSession, type FixedOutputs, type RunOutputs, type SessionKind } from './ort-session.js';
import { isFatal, loadRuntime, RuntimeGone } from './load-runtime.js';
import type { GeneratorModel } from './open-model.js';
import { ELEMENT_BYTES, TENSOR_USAGE } from './tensor-buffers.js';

export interface StartOptions {
  readonly model: GeneratorModel;
  readonly device: GPUDevice;
  /** Inputs of the first run. */
  readonly inputs: Inputs;
  /** Throws if the session is not needed anymore or the device is lost, so that further attempts are useless. */
  readonly requireLife: () => void;
  /** Called when the model has broken a copy of the runtime. */
  readonly onBreakage: () => void;
  /** Called when the model runs on the CPU, with the reason in English. */
  readonly onFallback: (reason: string) => void;
  /** Reason that the model must not run on the GPU; undefined if it may. */
  readonly refusal?: string;
  /** Whether the output of the first run on the GPU is read back for a comparison with the CPU. */
  readonly keepsEvidence?: boolean;
  /**
   * Called with the outputs of the first run, which serve the request that starts the session, before any run for graph
   * capture. The function must submit its GPU work before it returns, and must not throw. It is called again only if a
   * later start replaces the first one.
   */
  readonly onFirstRun?: (outputs: RunOutputs) => void;
}

/** A session that has run, and the evidence of its first run on the GPU if a comparison is requested. */
export interface StartedSession {
  readonly session: OrtSession;
  readonly evidence?: Evidence;
}

/**
 * Starts a session and runs it once, so that all kernels are compiled. Uses graph capture if model and runtime allow
 * it, else commands that are encoded for every run, else the CPU.
 * @throws ContractError `contract/run` if the model does not run; GaussianSplatError `network/*` if the runtime is
 * unavailable; RuntimeGone if another model has broken the runtime meanwhile; errors of `requireLife`.
 */
export async function startSession(options: StartOptions): Promise<StartedSession> {
  // All runs of the start must have equal inputs. The first run replaces the state of the model, and a page may upload
  // another image before the last run.
  const { inputs, buffers } = replaceGpuInputs(options, copied);
  try {
    return await startWith({ ...options, inputs });
  } finally {
    for (const buffer of buffers) buffer.destroy();
  }
}

async function startWith(options: StartOptions): Promise<StartedSession> {
  const { model, device, onFallback, refusal } = options;
  const refusals: string[] = [];
  if (refusal !== undefined) {
    refusals.push(refusal);
  } else if (isHalfWithoutFeature(model, device)) {
    refusals.push('webgpu: its float16 tensors need the device feature shader-f16, which this device does not have');
  } else if (isSlower(model, device)) {
    refusals.push(
      'webgpu: this browser has no hardware GPU, and its software GPU is slower than the CPU for this model',
    );
  } else if (miscomputedNodes(model.header).length > 0) {
    const [{ operator, reason, remedy }] = miscomputedNodes(model.header);
    refusals.push(`webgpu: ${operator}: ${reason}; ${remedy}`);
  } else {
    const started = await startOnGpu(options, refusals);
    if (started) return started;
  }
  const reason = refusals.join('; ');
  const started = await start('wasm', options, refusals, (outputs) => {
    // Listeners may request results again that the GPU has computed wrongly. This run serves that request.
    onFallback(reason);
    options.onFirstRun?.(outputs);
  });
  if (started === undefined) throw new ContractError([runFault(model, refusals.join('; '))]);
  return { session: started.session };
}

/**
 * Starts a session on the GPU, with graph capture if its results equal those of encoded commands, for the inputs of the
 * capture and for others. This check is needed because only kernels are captured: a reshaped result is copied in the
 * first run and then never again. Outputs that are constants are kept from the first run. Returns undefined if the
 * model does not run on the GPU, with reasons in `refusals`.
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

/**
 * Replaces a session by a captured one, or by one with encoded commands if capture fails or gives other results.
 * Returns undefined if that session does not start, either.
 * @param changed The options with other inputs.
 */
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
  // The first session is released before the second is created, because each holds the weights.
  await plain.session.release();
  const recorded = await start('captured', options, [], undefined, fixed);
  if (recorded && isEqual(recorded.written, plain.written)) {
    const replayed = await attempt(recorded.session, changed, []);
    if (replayed && isEqual(replayed, expected)) return recorded.session;
  }
  await recorded?.session.release();
  return (await start('webgpu', options, refusals))?.session;
}

/** Returns the contract fault for an error of the runtime. @param found Message of the error. */
export function runFault({ header }: GeneratorModel, found: string): ContractFault {
  return {
    code: 'contract/run',
    where: header.name,
    expected: 'a model that ONNX Runtime runs',
    found: found.slice(0, 1000),
    remedy: 'run it in a shell (gaussian-splat check MODEL --run), and correct or simplify the refused nodes',
  };
}

function isHalfWithoutFeature({ header, outputs }: GeneratorModel, device: GPUDevice): boolean {
  const isHalf = [...outputs, ...header.inputs].some(({ dtype }) => dtype === 'float16');
  return isHalf && !device.features.has('shader-f16');
}

/**
 * Whether the GPU of a device is software, which computes a large model more slowly than the runtime does on the CPU. A
 * model that runs in each frame stays there, because runs on the CPU block the page.
 */
const isSlower = (model: GeneratorModel, { adapterInfo }: GPUDevice): boolean =>
  (adapterInfo as GPUAdapterInfo | undefined)?.isFallbackAdapter === true && cadenceOf(model) === 'chosen';

const hasLoop = ({ header }: GeneratorModel): boolean =>
  ['Loop', 'Scan'].some((operator) => header.operators.has(operator));

/**
 * Whether graph capture is possible: all shapes are fixed, and all inputs are on the GPU, which has no 64-bit integers.
 */
function canBeRecorded({ header }: GeneratorModel): boolean {
  const isFixed = [...header.inputs, ...header.outputs].every(({ dims }) =>
    dims?.every((dim) => typeof dim === 'number'),
  );
  return isFixed && header.inputs.every(({ dtype }) => dtype !== 'int64');
}

/** Inputs with buffers of their own. */
interface OwnInputs {
  readonly inputs: Inputs;
  /** Buffers that the caller destroys when no run uses them anymore. */
  readonly buffers: readonly GPUBuffer[];
}

/** Replaces the buffer of each input on the GPU, such as an image, a state or Gaussians, by the result of `replace`. */
function replaceGpuInputs(
  { device, inputs }: StartOptions,
  replace: (device: GPUDevice, input: GpuTensor) => GPUBuffer,
): OwnInputs {
  const buffers: GPUBuffer[] = [];
  const own = Object.entries(inputs).map(([name, value]): [string, InputValue] => {
    if (!isOnGpu(value)) return [name, value];
    const buffer = replace(device, value);
    buffers.push(buffer);
    return [name, { ...value, buffer }];
  });
  return { inputs: Object.fromEntries(own), buffers };
}

/**
 * Returns inputs that differ from the given ones, including images and Gaussians on the GPU. They need not be
 * meaningful to the model, because only two runs are compared.
 */
function otherInputs(options: StartOptions): OwnInputs {
  const { inputs, buffers } = replaceGpuInputs(options, filled);
  const changed = Object.entries(inputs).map(([name, value]): [string, InputValue] => {
    if (isOnGpu(value)) return [name, value];
    if (value.dtype === 'float32') return [name, { ...value, data: numbers(value.data).map(otherNumber) }];
    // Uses 0 and 1, the integers most likely to be valid as indices.
    if (value.dtype === 'int32') return [name, { ...value, data: numbers(value.data).map((x) => (x === 0 ? 1 : 0)) }];
    return [name, value];
  });
  return { inputs: Object.fromEntries(changed), buffers };
}

/** Returns a number that differs from each number, and lies in 0..1 if that does. */
const otherNumber = (x: number): number => (x < 0.5 ? 0.75 * x + 0.25 : 0.75 * x);

const numbers = (data: unknown): Float32Array | Int32Array => data as Float32Array | Int32Array;

/**
 * Words to fill a tensor with, by element type: 0.25 as float32, and twice 0.25 as float16. No image and no Gaussians
 * have this value everywhere. Counts of rows are 0.
 */
const QUARTERS = { float32: 0x3e80_0000, float16: 0x3400_3400, int32: 0 } as const;

/** Returns a buffer of the same size as a tensor's, filled with one number. */
function filled(device: GPUDevice, { buffer, dtype }: GpuTensor): GPUBuffer {
  const size = Math.ceil(buffer.size / 4) * 4;
  const other = device.createBuffer({ label: 'gs.generator.other', size, usage: TENSOR_USAGE, mappedAtCreation: true });
  new Uint32Array(other.getMappedRange()).fill(QUARTERS[dtype]);
  other.unmap();
  return other;
}

/** Returns a buffer with the content of a tensor. */
function copied(device: GPUDevice, { buffer, dtype, dims }: GpuTensor): GPUBuffer {
  const size = Math.ceil((elementsOf(dims) * ELEMENT_BYTES[dtype]) / 4) * 4;
  const own = device.createBuffer({ label: 'gs.generator.start', size, usage: TENSOR_USAGE });
  const encoder = device.createCommandEncoder({ label: 'gs.generator.copy' });
  encoder.copyBufferToBuffer(buffer, 0, own, 0, size);
  device.queue.submit([encoder.finish()]);
  return own;
}

interface Started {
  readonly session: OrtSession;
  /** Output of the session's first run. */
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
  // A slow GPU does not make a model slow on the CPU, but a loop without end would block the page there.
  const isOnlySlow = runtime.hasTimedOut && kind !== 'wasm' && !hasLoop(model);
  // A model that has broken the runtime would break it again.
  if (runtime.isBroken && !isOnlySlow) {
    options.onBreakage();
    throw new ContractError([runFault(model, refusals.join('; '))]);
  }
  return undefined;
}

/**
 * Runs a session once, and returns ranges of the output; undefined if the run fails.
 * @throws RuntimeGone, after releasing the session
 */
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

/** Returns the message of an error for people, without the places in the runtime's source code. */
function messageOf(error: unknown): string {
  const message = (error instanceof Error ? error.message : String(error)).replace(/ ?\/\S*onnxruntime\/\S+/g, '');
  return isFatal(error)
    ? `ONNX Runtime has stopped in this browser (${message}); a newer version of the browser or of its system may run the model`
    : message;
}
