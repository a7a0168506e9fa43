import { ContractError } from '@gaussian-splat/core/contract';
import { misfusedProducts } from '@gaussian-splat/core/onnx';
import type { InferenceSession, Tensor } from 'onnxruntime-web/webgpu';
import {
  elementsOf,
  isOnGpu,
  type GpuTensor,
  type InputNumbers,
  type Inputs,
  type InputValue,
} from '../input-value.js';
import { RuntimeGone, type Runtime } from './load-runtime.js';
import type { ModelOutput } from './model-outputs.js';
import type { GeneratorModel } from './open-model.js';
import { numbersOf } from './first-run.js';
import { SessionBuffers } from './session-buffers.js';
import { bufferBytes } from './tensor-buffers.js';

/** Kind of a session: captured GPU commands, GPU commands that are encoded for each run, or the CPU. */
export type SessionKind = 'captured' | 'webgpu' | 'wasm';

/** Output of one run: storage buffers by output name, valid until the next run. */
export interface RunOutputs {
  readonly tensors: Readonly<Record<string, GPUBuffer>>;
  /** Dimensions of each output in this run, by output name. */
  readonly dims: Readonly<Record<string, readonly number[]>>;
  /** Number of rows of Gaussians of one instance in this run; 1 for an image. */
  readonly rows: number;
}

/** An output that is the same in every run, so that it is kept and not requested again. */
export interface FixedOutput {
  readonly buffer: GPUBuffer;
  readonly dims: readonly number[];
}

/** Fixed outputs by name. */
export type FixedOutputs = Record<string, FixedOutput>;

/** Suppresses log messages, because the runtime's errors contain them, too. */
const QUIET = { logSeverityLevel: 4 } as const;

/**
 * Defines `adapterInfo` of a device that lacks it, as in Safari 26.0. ONNX Runtime reads its fields for each device that
 * it is given, and a device without them aborts its WebAssembly ("unreachable").
 */
function provideAdapterInfo(device: GPUDevice): void {
  if ((device as Partial<GPUDevice>).adapterInfo) return;
  const value = { vendor: '', architecture: '', device: '', description: '', subgroupMinSize: 0, subgroupMaxSize: 0 };
  Object.defineProperty(device, 'adapterInfo', { value, configurable: true });
}

/** A session of ONNX Runtime with inputs and outputs on the GPU. It must not be used again after a failed run. */
export class OrtSession {
  readonly kind: SessionKind;
  /** The session's copy of the runtime, which may be unusable. */
  readonly runtime: Runtime;
  readonly #session: InferenceSession;
  readonly #device: GPUDevice;
  readonly #outputs: readonly ModelOutput[];
  readonly #instances: number;
  readonly #names: readonly string[];
  readonly #fixed: Readonly<FixedOutputs>;
  readonly #buffers: SessionBuffers;
  readonly #feeds: Record<string, Tensor> = {};
  #hasFailed = false;
  #isReleased = false;
  /** Output buffers of a captured session, which its commands write in every run. */
  #written: readonly GPUBuffer[] = [];

  private constructor(
    kind: SessionKind,
    runtime: Runtime,
    session: InferenceSession,
    device: GPUDevice,
    { outputs, instances }: GeneratorModel,
    fixed: Readonly<FixedOutputs>,
  ) {
    this.kind = kind;
    this.runtime = runtime;
    this.#session = session;
    this.#device = device;
    this.#outputs = outputs;
    this.#instances = instances ?? 1;
    // At least one output is requested, because a run without outputs would compute nothing.
    this.#fixed = outputs.every(({ name }) => name in fixed) ? {} : fixed;
    this.#names = outputs.map(({ name }) => name).filter((name) => !(name in this.#fixed));
    this.#buffers = new SessionBuffers(device);
  }

  /**
   * Creates a session of the runtime.
   * @param fixed Outputs that are never requested. The session owns and destroys them if it is created.
   * @throws errors of the runtime.
   */
  static async create(
    kind: SessionKind,
    runtime: Runtime,
    model: GeneratorModel,
    device: GPUDevice,
    fixed: Readonly<FixedOutputs> = {},
  ): Promise<OrtSession> {
    provideAdapterInfo(device);
    const options: InferenceSession.SessionOptions = {
      ...QUIET,
      freeDimensionOverrides: fixedDimensions(model),
      externalData: model.externalData.map(({ path, data }) => ({ path, data })),
    };
    const onGpu: InferenceSession.SessionOptions = {
      executionProviders: [{ name: 'webgpu', device, validationMode: 'basic' }],
      preferredOutputLocation: 'gpu-buffer',
      enableGraphCapture: kind === 'captured',
    };
    // The graph runs without fusions on the CPU, and if fusions of the runtime are known to be wrong for it.
    const isFused = kind !== 'wasm' && misfusedProducts(model.header).length === 0;
    const session = await runtime.exclusive(() =>
      runtime.ort.InferenceSession.create(model.bytes, {
        ...options,
        graphOptimizationLevel: isFused ? 'all' : 'basic',
        ...(kind === 'wasm' ? { executionProviders: ['wasm'] } : onGpu),
      }),
    );
    return new OrtSession(kind, runtime, session, device, model, fixed);
  }

  /** Whether a run has failed. */
  get hasFailed(): boolean {
    return this.#hasFailed;
  }

  /**
   * Runs the model, and calls `use` with its output. `use` must submit its GPU work before it returns, and no other
   * call of the runtime runs meanwhile.
   * @throws errors of the runtime, after setting {@link hasFailed}; RuntimeGone if the run never started, because the
   * runtime or the session is gone; or errors of `use`.
   */
  async run(inputs: Inputs, use: (outputs: RunOutputs) => void): Promise<void> {
    try {
      await this.runtime.exclusive(() => {
        if (this.#isReleased) throw new RuntimeGone('the session was released');
        return this.#run(inputs, use);
      });
    } catch (error) {
      if (this.runtime.isBroken && !(error instanceof RuntimeGone)) this.#hasFailed = true;
      throw error;
    }
  }

  /** Releases the session and all buffers. Never rejects, although the release of a failed session may fail. */
  async release(): Promise<void> {
    if (this.#isReleased) return;
    this.#isReleased = true;
    await this.runtime.exclusive(() => this.#session.release()).catch(() => undefined);
    this.#buffers.destroy();
    // The runtime does not free the output buffers of a captured session.
    for (const buffer of this.#written) buffer.destroy();
    for (const { buffer } of Object.values(this.#fixed)) buffer.destroy();
  }

  async #run(inputs: Inputs, use: (outputs: RunOutputs) => void): Promise<void> {
    const results = await this.#infer(inputs);
    if (this.kind === 'captured') this.#written = this.#names.flatMap((name) => gpuBufferOf(results[name]));
    try {
      const dims = Object.fromEntries(
        this.#outputs.map(({ name }) => [name, this.#fixed[name]?.dims ?? results[name].dims]),
      );
      use({ tensors: this.#buffersOf(results), dims, rows: rowsOf(dims, this.#outputs, this.#instances) });
    } finally {
      // Frees the outputs after their submissions. A captured session keeps its buffers.
      if (this.kind === 'webgpu') for (const name of this.#names) disposeGpu(results[name]);
    }
  }

  async #infer(inputs: Inputs): Promise<Record<string, Tensor>> {
    try {
      for (const [name, input] of Object.entries(inputs)) await this.#feed(name, input);
      return await this.#session.run(this.#feeds, this.#names, QUIET);
    } catch (error) {
      this.#hasFailed = true;
      throw error;
    }
  }

  /**
   * Sets an input of the next run. Inputs are in buffers of this session, because the runtime would create new ones for
   * every run, and captured commands always read the same buffers.
   */
  async #feed(name: string, input: InputValue): Promise<void> {
    const isRead = this.kind === 'wasm' || input.dtype === 'int64';
    if (isRead) {
      const { Tensor } = this.runtime.ort;
      const data = isOnGpu(input) ? await numbersOf(this.#device, input) : input.data;
      this.#feeds[name] = new Tensor(input.dtype, data as never, input.dims);
      return;
    }
    const buffer = this.#tensorOn(name, input);
    if (isOnGpu(input)) this.#buffers.copy(input.buffer, buffer, bytesOf(input));
    else this.#buffers.write(buffer, input.data as Float32Array<ArrayBuffer>);
  }

  /** Returns the GPU buffer of an input. Replaces its tensor in the feeds if the buffer or the shape has changed. */
  #tensorOn(name: string, { dtype, dims }: InputValue): GPUBuffer {
    const buffer = this.#buffers.of(`input.${name}`, bufferBytes(dtype, elementsOf(dims)));
    const feed = this.#feeds[name] as Tensor | undefined;
    const isSame = feed?.gpuBuffer === buffer && feed.dims.every((dim, i) => dim === dims[i]);
    if (!isSame) {
      const dataType = dtype as 'float32' | 'float16' | 'int32';
      this.#feeds[name] = this.runtime.ort.Tensor.fromGpuBuffer(buffer, { dataType, dims });
    }
    return buffer;
  }

  #buffersOf(results: Readonly<Record<string, Tensor>>): Record<string, GPUBuffer> {
    const tensors: Record<string, GPUBuffer> = {};
    for (const output of this.#outputs) {
      if (output.name in this.#fixed) {
        tensors[output.name] = this.#fixed[output.name].buffer;
        continue;
      }
      const tensor = results[output.name];
      tensors[output.name] =
        tensor.location === 'gpu-buffer' ? (tensor.gpuBuffer as GPUBuffer) : this.#upload(output, tensor);
    }
    return tensors;
  }

  /** Uploads an output in CPU memory to a GPU buffer. Empty outputs are in CPU memory for any kind of session. */
  #upload({ name, max }: ModelOutput, { type, data, size }: Tensor): GPUBuffer {
    const buffer = this.#buffers.of(`output.${name}`, bufferBytes(type, max ?? size));
    // A size above the maximum is not uploaded; the consumer rejects it.
    if (size > 0 && size <= (max ?? size)) this.#buffers.write(buffer, data as Float32Array<ArrayBuffer>);
    return buffer;
  }
}

/**
 * Returns the size of the axis of instances by its name, because graph capture needs fixed sizes and the file has a
 * symbolic one.
 */
function fixedDimensions({ contract, instances }: GeneratorModel): Record<string, number> | undefined {
  return instances === undefined ? undefined : { [contract.instances!.axis]: instances };
}

const bytesOf = ({ dtype, dims }: GpuTensor | InputNumbers): number => elementsOf(dims) * (dtype === 'float16' ? 2 : 4);

const gpuBufferOf = (tensor: Tensor): GPUBuffer[] =>
  tensor.location === 'gpu-buffer' ? [tensor.gpuBuffer as GPUBuffer] : [];

function disposeGpu(tensor: Tensor): void {
  if (tensor.location === 'gpu-buffer') tensor.dispose();
}

/** Returns the number of rows of one instance, which must be equal for all tensors of Gaussians. */
function rowsOf(
  dims: Readonly<Record<string, readonly number[]>>,
  outputs: readonly ModelOutput[],
  instances: number,
): number {
  const counts = outputs
    .filter(({ kind }) => kind === 'gaussians')
    .map(({ name, rowElements = 1 }) => ({ tensor: name, count: elementsOf(dims[name]) / rowElements / instances }));
  if (counts.length === 0) return 1;
  const [{ tensor: first, count: rows }] = counts;
  for (const { tensor, count } of counts) {
    if (count === rows) continue;
    throw new ContractError([
      {
        code: 'contract/rows',
        tensor,
        where: `output ${tensor}`,
        expected: `${rows} rows, as ${first} has`,
        found: `${count} rows`,
        remedy: 'write the same number of rows for every attribute',
      },
    ]);
  }
  return rows;
}
