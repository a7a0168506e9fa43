import { numberToHalf } from '@gaussian-splat/core';
import { ContractError } from '@gaussian-splat/core/contract';
import { SessionBuffers } from '../runtime/session-buffers.js';
import { bufferBytes } from '../runtime/tensor-buffers.js';
import { elementsOf, type GpuTensor, type Inputs } from '../input-value.js';
import type { RunOutputs } from '../runtime/ort-session.js';
import type { GeneratorModel } from '../runtime/open-model.js';
import type { Connection } from './connect.js';

/**
 * Tensors between two models of a chain, or between two runs of one model: outputs of the first, kept on the GPU until
 * the second has run.
 */
export class HandOver extends SessionBuffers {
  readonly #device: GPUDevice;
  readonly #model: GeneratorModel;
  readonly #connections: readonly Connection[];
  #tensors: Record<string, GpuTensor> = {};
  #rows = 0;
  #version = 0;

  /** Creates an empty hand-over. @param model The model that writes the tensors. */
  constructor(device: GPUDevice, model: GeneratorModel, connections: readonly Connection[]) {
    super(device);
    this.#device = device;
    this.#model = model;
    this.#connections = connections;
  }

  /** Names of the second model's inputs that the first model writes. */
  get inputs(): ReadonlySet<string> {
    return new Set(this.#connections.map(({ input }) => input));
  }

  /** Last outputs of the first model, by input name of the second. */
  get tensors(): Inputs {
    return this.#tensors;
  }

  /** Number of rows of Gaussians. With 0 rows, the second model need not run. */
  get rows(): number {
    return this.#rows;
  }

  /**
   * Copies the outputs of the first model, because the runtime reuses its buffers.
   * @throws ContractError `contract/rows` if the rows exceed the declared maximum. The previous content then remains.
   */
  take({ tensors, dims, rows }: RunOutputs): void {
    const { layout, header } = this.#model;
    const max = layout?.paddedRows ?? layout?.capacity ?? Infinity;
    if (rows > max) throw tooManyRows(header.name, max, rows);
    this.#version++;
    this.#rows = rows;
    const encoder = this.#device.createCommandEncoder({ label: 'gs.generator.hand-over' });
    const taken: Record<string, GpuTensor> = {};
    for (const { output, input, dims: ones = [1] } of this.#connections) {
      taken[input] = output === undefined ? this.#countRows(input, ones) : this.#shaped(input, output, dims[output]);
      const { buffer } = taken[input];
      if (output !== undefined && buffer.size > 0) {
        encoder.copyBufferToBuffer(tensors[output], 0, buffer, 0, usedBytes(taken[input]));
      }
    }
    this.#device.queue.submit([encoder.finish()]);
    this.#tensors = taken;
  }

  /** Fills the tensor of an input with one number, for the time before the first run. */
  fill(input: string, { dtype, dims }: Pick<GpuTensor, 'dtype' | 'dims'>, value: number): void {
    const length = elementsOf(dims);
    const buffer = this.of(`chain.${input}`, bufferBytes(dtype, length));
    const words = new Uint32Array(buffer.size / 4).fill(wordOf(dtype, value));
    this.#device.queue.writeBuffer(buffer, 0, words);
    this.#tensors = { ...this.#tensors, [input]: { buffer, dtype, dims, version: ++this.#version } };
  }

  #shaped(input: string, output: string, dims: readonly number[]): GpuTensor {
    const { dtype: written, max } = this.#model.outputs.find(({ name }) => name === output)!;
    // A 64-bit count is no input of another model, because `connect` requires equal types on both sides.
    const dtype = written as GpuTensor['dtype'];
    const buffer = this.of(`chain.${input}`, bufferBytes(dtype, max ?? elementsOf(dims)));
    return { buffer, dtype, dims, version: this.#version };
  }

  #countRows(input: string, dims: readonly number[]): GpuTensor {
    const buffer = this.of(`chain.${input}`, bufferBytes('int32', 1));
    this.#device.queue.writeBuffer(buffer, 0, Int32Array.of(this.#rows));
    return { buffer, dtype: 'int32', dims, version: this.#version };
  }
}

/** Returns a 32-bit word with the bits of a number: once, or twice for float16. */
function wordOf(dtype: GpuTensor['dtype'], value: number): number {
  if (dtype === 'float16') return numberToHalf(value) * 0x1_0001;
  const Numbers = dtype === 'int32' ? Int32Array : Float32Array;
  return new Uint32Array(Numbers.of(value).buffer)[0];
}

const usedBytes = ({ dtype, dims }: GpuTensor): number =>
  Math.ceil((elementsOf(dims) * (dtype === 'float16' ? 2 : 4)) / 4) * 4;

const tooManyRows = (name: string, capacity: number, rows: number): ContractError =>
  new ContractError([
    {
      code: 'contract/rows',
      where: `a run of ${name}`,
      expected: `at most ${capacity} rows, the nMax of its contract`,
      found: `${rows}`,
      remedy: 'raise nMax in the contract to the maximum number of rows of a run',
    },
  ]);
