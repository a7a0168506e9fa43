import { ContractError, type GaussianLayout } from '@gaussian-splat/core';
import type { InferenceSession, Tensor } from 'onnxruntime-web/webgpu';
import type { InputValue } from '../bind-inputs.js';
import type { Runtime } from './load-runtime.js';
import type { GeneratorModel } from './open-model.js';
import { bufferBytes, TENSOR_USAGE } from './tensor-bytes.js';

/** How a session runs: recorded GPU commands, GPU commands made anew, or the CPU. */
export type SessionKind = 'captured' | 'webgpu' | 'wasm';

/** What one run wrote: storage buffers by the names of the outputs, valid until the next run. */
export interface RunOutputs {
  readonly tensors: Readonly<Record<string, GPUBuffer>>;
  /** Rows that this run wrote. */
  readonly rows: number;
}

/** What the runtime would log comes with its errors, too. */
const QUIET = { logSeverityLevel: 4 } as const;

type Inputs = Readonly<Record<string, InputValue>>;

/** A session of ONNX Runtime with its inputs and outputs on the GPU. After a run that failed it must not be used again. */
export class LiveSession {
  readonly kind: SessionKind;
  readonly #runtime: Runtime;
  readonly #session: InferenceSession;
  readonly #device: GPUDevice;
  readonly #layout: GaussianLayout;
  readonly #outputs: readonly string[];
  readonly #buffers = new Map<string, GPUBuffer>();
  readonly #feeds: Record<string, Tensor> = {};
  #hasFailed = false;

  private constructor(
    kind: SessionKind,
    runtime: Runtime,
    session: InferenceSession,
    device: GPUDevice,
    { layout }: GeneratorModel,
  ) {
    this.kind = kind;
    this.#runtime = runtime;
    this.#session = session;
    this.#device = device;
    this.#layout = layout;
    const count = layout.count === undefined ? [] : [layout.count];
    this.#outputs = [...new Set([...layout.attributes.map(({ tensor }) => tensor), ...count])];
  }

  /** @throws whatever the runtime says. */
  static async create(
    kind: SessionKind,
    runtime: Runtime,
    model: GeneratorModel,
    device: GPUDevice,
  ): Promise<LiveSession> {
    const options: InferenceSession.SessionOptions = {
      ...QUIET,
      externalData: model.externalData.map(({ path, data }) => ({ path, data })),
    };
    const onGpu: InferenceSession.SessionOptions = {
      executionProviders: [{ name: 'webgpu', device, validationMode: 'basic' }],
      preferredOutputLocation: 'gpu-buffer',
      enableGraphCapture: kind === 'captured',
    };
    const session = await runtime.exclusive(() =>
      runtime.ort.InferenceSession.create(model.bytes, {
        ...options,
        ...(kind === 'wasm' ? { executionProviders: ['wasm'] } : onGpu),
      }),
    );
    return new LiveSession(kind, runtime, session, device, model);
  }

  /** True after a run that failed. */
  get hasFailed(): boolean {
    return this.#hasFailed;
  }

  /**
   * Runs the model, and hands what it wrote to `use`, which must submit all its work before it returns. Nothing else of the runtime
   * runs in between.
   * @throws what the runtime says, and then {@link hasFailed}; or what `use` throws.
   */
  run(inputs: Inputs, use: (outputs: RunOutputs) => void): Promise<void> {
    return this.#runtime.exclusive(async () => {
      const results = await this.#infer(inputs);
      try {
        use({ tensors: this.#buffersOf(results), rows: rowsOf(results, this.#layout) });
      } finally {
        // Recycled for what is submitted later; a captured session writes the same buffers for ever.
        if (this.kind === 'webgpu') for (const name of this.#outputs) disposeGpu(results[name]);
      }
    });
  }

  /** Lets go of everything. Never rejects: a session that has failed may not even be able to leave. */
  async release(): Promise<void> {
    await this.#runtime.exclusive(() => this.#session.release()).catch(() => undefined);
    for (const buffer of this.#buffers.values()) buffer.destroy();
    this.#buffers.clear();
  }

  async #infer(inputs: Inputs): Promise<Record<string, Tensor>> {
    try {
      for (const [name, input] of Object.entries(inputs)) this.#feed(name, input);
      return await this.#session.run(this.#feeds, this.#outputs, QUIET);
    } catch (error) {
      this.#hasFailed = true;
      throw error;
    }
  }

  /** Inputs live in buffers of ours: the runtime would make new ones for every run. */
  #feed(name: string, { dtype, dims, data }: InputValue): void {
    const { Tensor } = this.#runtime.ort;
    // WebGPU has no 64-bit integers: such inputs are read on the CPU.
    if (this.kind === 'wasm' || dtype === 'int64') {
      this.#feeds[name] = new Tensor(dtype, data as never, dims);
      return;
    }
    const buffer = this.#bufferFor(`input.${name}`, bufferBytes(dtype, data.length));
    this.#feeds[name] ??= Tensor.fromGpuBuffer(buffer, { dataType: dtype, dims });
    this.#device.queue.writeBuffer(buffer, 0, data as Float32Array<ArrayBuffer>);
  }

  #bufferFor(name: string, size: number): GPUBuffer {
    let buffer = this.#buffers.get(name);
    if (buffer === undefined) {
      buffer = this.#device.createBuffer({ label: `gs.generator.${name}`, size, usage: TENSOR_USAGE });
      this.#buffers.set(name, buffer);
    }
    return buffer;
  }

  #buffersOf(results: Readonly<Record<string, Tensor>>): Record<string, GPUBuffer> {
    const tensors: Record<string, GPUBuffer> = {};
    for (const name of this.#outputs) {
      const tensor = results[name];
      tensors[name] = tensor.location === 'gpu-buffer' ? (tensor.gpuBuffer as GPUBuffer) : this.#upload(name, tensor);
    }
    return tensors;
  }

  /** Outputs of the CPU; empty ones are there, too, wherever the model ran. */
  #upload(name: string, { type, data, size }: Tensor): GPUBuffer {
    const slice = this.#layout.attributes.find(({ tensor }) => tensor === name);
    const most = slice ? this.#layout.capacity * slice.rowStride : 1;
    const buffer = this.#bufferFor(`output.${name}`, bufferBytes(type, most));
    // More than the contract allows is refused by whoever takes it.
    if (size === 0 || size > most) return buffer;
    const { buffer: memory, byteOffset, byteLength } = data as Float32Array<ArrayBuffer>;
    const whole = byteLength - (byteLength % 4);
    this.#device.queue.writeBuffer(buffer, 0, memory, byteOffset, whole);
    if (whole < byteLength)
      this.#writeRest(buffer, whole, new Uint8Array(memory, byteOffset + whole, byteLength - whole));
    return buffer;
  }

  /** GPU buffers are written in whole words; an odd number of float16 is not. */
  #writeRest(buffer: GPUBuffer, at: number, rest: Uint8Array): void {
    const word = new Uint8Array(4);
    word.set(rest);
    this.#device.queue.writeBuffer(buffer, at, word);
  }
}

function disposeGpu(tensor: Tensor): void {
  if (tensor.location === 'gpu-buffer') tensor.dispose();
}

/** Rows of all tensors, which must agree. */
function rowsOf(results: Readonly<Record<string, Tensor>>, { attributes }: GaussianLayout): number {
  const [first] = attributes;
  const rows = results[first.tensor].dims[0];
  for (const { tensor } of attributes) {
    if (results[tensor].dims[0] === rows) continue;
    throw new ContractError([
      {
        code: 'contract/rows',
        tensor,
        where: `output ${tensor}`,
        expected: `${rows} rows, as ${first.tensor} has`,
        found: `${results[tensor].dims[0]} rows`,
        remedy: 'write as many rows of every attribute',
      },
    ]);
  }
  return rows;
}
