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

/** Kind of a session: captured GPU commands, GPU commands encoded for each run, or the CPU. */
export type SessionKind = 'captured' | 'webgpu' | 'wasm';

/** Output of one run: storage buffers by the names of the outputs, valid until the next run. */
export interface RunOutputs {
  readonly tensors: Readonly<Record<string, GPUBuffer>>;
  /** Shapes of this run, by the same names. */
  readonly dims: Readonly<Record<string, readonly number[]>>;
  /** Rows of Gaussians of one instance in this run; 1 for an image. */
  readonly rows: number;
}

/** An output that is the same in every run: it is kept, and not requested again. */
export interface FixedOutput {
  readonly buffer: GPUBuffer;
  readonly dims: readonly number[];
}

/** Fixed outputs by name. */
export type FixedOutputs = Record<string, FixedOutput>;

/** Log messages of the runtime are part of its errors, too. */
const QUIET = { logSeverityLevel: 4 } as const;

/** A session of ONNX Runtime with its inputs and outputs on the GPU. After a failed run it must not be used again. */
export class OrtSession {
  readonly kind: SessionKind;
  readonly #runtime: Runtime;
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
  /** Output buffers of a captured session. */
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
    this.#runtime = runtime;
    this.#session = session;
    this.#device = device;
    this.#outputs = outputs;
    this.#instances = instances ?? 1;
    // A run without requested outputs would compute nothing.
    this.#fixed = outputs.every(({ name }) => name in fixed) ? {} : fixed;
    this.#names = outputs.map(({ name }) => name).filter((name) => !(name in this.#fixed));
    this.#buffers = new SessionBuffers(device);
  }

  /**
   * @param fixed Outputs that are never requested; a session that is created with them owns and destroys them.
   * @throws errors of the runtime.
   */
  static async create(
    kind: SessionKind,
    runtime: Runtime,
    model: GeneratorModel,
    device: GPUDevice,
    fixed: Readonly<FixedOutputs> = {},
  ): Promise<OrtSession> {
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
    // On the CPU, and if the runtime's fusions are known to be wrong, the graph runs without fusions.
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

  /** Whether its copy of the runtime is unusable. */
  get hasBrokenRuntime(): boolean {
    return this.#runtime.isBroken;
  }

  /**
   * Runs the model, and calls `use` with its output, which must submit all its work before it returns. No other call of
   * the runtime runs in between.
   * @throws errors of the runtime, with {@link hasFailed} set; RuntimeGone if it never started, because the runtime or
   * the session is gone; or errors of `use`.
   */
  async run(inputs: Inputs, use: (outputs: RunOutputs) => void): Promise<void> {
    try {
      await this.#runtime.exclusive(() => {
        if (this.#isReleased) throw new RuntimeGone('the session was released');
        return this.#run(inputs, use);
      });
    } catch (error) {
      if (this.#runtime.isBroken && !(error instanceof RuntimeGone)) this.#hasFailed = true;
      throw error;
    }
  }

  /** Releases everything. Never rejects: even releasing a failed session may fail. */
  async release(): Promise<void> {
    if (this.#isReleased) return;
    this.#isReleased = true;
    await this.#runtime.exclusive(() => this.#session.release()).catch(() => undefined);
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
      // Freed for later submissions; a captured session keeps its buffers.
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
   * Inputs are kept in our own buffers: the runtime would create new ones for every run, and captured commands always
   * read the same ones.
   */
  async #feed(name: string, input: InputValue): Promise<void> {
    const isRead = this.kind === 'wasm' || input.dtype === 'int64';
    if (isRead) {
      const { Tensor } = this.#runtime.ort;
      const data = isOnGpu(input) ? await numbersOf(this.#device, input) : input.data;
      this.#feeds[name] = new Tensor(input.dtype, data as never, input.dims);
      return;
    }
    const buffer = this.#tensorOn(name, input);
    if (isOnGpu(input)) this.#buffers.copy(input.buffer, buffer, bytesOf(input));
    else this.#device.queue.writeBuffer(buffer, 0, input.data as Float32Array<ArrayBuffer>);
  }

  /** The buffer of an input, and its tensor of the runtime. */
  #tensorOn(name: string, { dtype, dims }: InputValue): GPUBuffer {
    const buffer = this.#buffers.of(`input.${name}`, bufferBytes(dtype, elementsOf(dims)));
    const feed = this.#feeds[name] as Tensor | undefined;
    const isSame = feed?.gpuBuffer === buffer && feed.dims.every((dim, i) => dim === dims[i]);
    if (!isSame) {
      const dataType = dtype as 'float32' | 'float16' | 'int32';
      this.#feeds[name] = this.#runtime.ort.Tensor.fromGpuBuffer(buffer, { dataType, dims });
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

  /** Outputs on the CPU; empty ones are on the CPU for any kind of session. */
  #upload({ name, max }: ModelOutput, { type, data, size }: Tensor): GPUBuffer {
    const buffer = this.#buffers.of(`output.${name}`, bufferBytes(type, max ?? size));
    // The consumer rejects more than the contract allows.
    if (size > 0 && size <= (max ?? size)) this.#buffers.write(buffer, data as Float32Array<ArrayBuffer>);
    return buffer;
  }
}

/** The axis of instances is symbolic in the file, but graph capture needs fixed sizes. */
function fixedDimensions({ contract, instances }: GeneratorModel): Record<string, number> | undefined {
  return instances === undefined ? undefined : { [contract.instances!.axis]: instances };
}

const bytesOf = ({ dtype, dims }: GpuTensor | InputNumbers): number => elementsOf(dims) * (dtype === 'float16' ? 2 : 4);

const gpuBufferOf = (tensor: Tensor): GPUBuffer[] =>
  tensor.location === 'gpu-buffer' ? [tensor.gpuBuffer as GPUBuffer] : [];

function disposeGpu(tensor: Tensor): void {
  if (tensor.location === 'gpu-buffer') tensor.dispose();
}

/** Rows of all tensors of Gaussians, which must agree. */
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
        remedy: 'write as many rows of every attribute',
      },
    ]);
  }
  return rows;
}
