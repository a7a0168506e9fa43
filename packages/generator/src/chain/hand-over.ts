import { numberToHalf } from '@gaussian-splat/core';
import { ContractError } from '@gaussian-splat/core/contract';
import { bufferBytes, TENSOR_USAGE } from '../runtime/tensor-buffers.js';
import { elementsOf, type GpuTensor, type Inputs } from '../input-value.js';
import type { RunOutputs } from '../runtime/ort-session.js';
import type { GeneratorModel } from '../runtime/open-model.js';
import type { Connection } from './connect.js';

/**
 * Tensors between two models of a chain, or two runs of one model: the first one's outputs, kept on the GPU until the
 * second has run.
 */
export class HandOver {
  readonly #device: GPUDevice;
  readonly #model: GeneratorModel;
  readonly #connections: readonly Connection[];
  readonly #buffers = new Map<string, GPUBuffer>();
  #tensors: Record<string, GpuTensor> = {};
  #rows = 0;
  #version = 0;

  /** @param model The first of the two. */
  constructor(device: GPUDevice, model: GeneratorModel, connections: readonly Connection[]) {
    this.#device = device;
    this.#model = model;
    this.#connections = connections;
  }

  /** Inputs of the second model that are not set by the page. */
  get inputs(): ReadonlySet<string> {
    return new Set(this.#connections.map(({ input }) => input));
  }

  /** Last outputs of the first model. */
  get tensors(): Inputs {
    return this.#tensors;
  }

  /** Rows of Gaussians in it; without any, the second model need not run. */
  get rows(): number {
    return this.#rows;
  }

  /**
   * Copies the output of the first model, because the runtime reuses its buffers.
   * @throws ContractError `contract/rows` if it exceeds the declared size. The previous content remains.
   */
  take({ tensors, dims, rows }: RunOutputs): void {
    const { layout, header } = this.#model;
    const max = layout?.paddedRows ?? layout?.capacity ?? Infinity;
    if (rows > max) throw tooManyRows(header.name, max, rows);
    this.#version++;
    this.#rows = rows;
    const encoder = this.#device.createCommandEncoder({ label: 'gs.generator.hand-over' });
    const taken: Record<string, GpuTensor> = {};
    for (const { output, input } of this.#connections) {
      taken[input] = output === undefined ? this.#countRows(input) : this.#shaped(input, output, dims[output]);
      const { buffer } = taken[input];
      if (output !== undefined && buffer.size > 0) {
        encoder.copyBufferToBuffer(tensors[output], 0, buffer, 0, usedBytes(taken[input]));
      }
    }
    this.#device.queue.submit([encoder.finish()]);
    this.#tensors = taken;
  }

  /** Before the first run, a tensor is filled with one number. */
  fill(input: string, { dtype, dims }: Pick<GpuTensor, 'dtype' | 'dims'>, value: number): void {
    const length = elementsOf(dims);
    const buffer = this.#bufferOf(input, bufferBytes(dtype, length));
    const words = new Uint32Array(buffer.size / 4).fill(wordOf(dtype, value));
    this.#device.queue.writeBuffer(buffer, 0, words);
    this.#tensors = { ...this.#tensors, [input]: { buffer, dtype, dims, version: ++this.#version } };
  }

  destroy(): void {
    for (const buffer of this.#buffers.values()) buffer.destroy();
    this.#buffers.clear();
  }

  #shaped(input: string, output: string, dims: readonly number[]): GpuTensor {
    const { dtype: written, max } = this.#model.outputs.find(({ name }) => name === output)!;
    // A 64-bit count feeds no input: `connect` requires the same type on both sides.
    const dtype = written as GpuTensor['dtype'];
    const buffer = this.#bufferOf(input, bufferBytes(dtype, max ?? elementsOf(dims)));
    return { buffer, dtype, dims, version: this.#version };
  }

  #countRows(input: string): GpuTensor {
    const buffer = this.#bufferOf(input, bufferBytes('int32', 1));
    this.#device.queue.writeBuffer(buffer, 0, Int32Array.of(this.#rows));
    return { buffer, dtype: 'int32', dims: [1], version: this.#version };
  }

  #bufferOf(input: string, size: number): GPUBuffer {
    const found = this.#buffers.get(input);
    if (found !== undefined && found.size >= size) return found;
    found?.destroy();
    const buffer = this.#device.createBuffer({ label: `gs.generator.chain.${input}`, size, usage: TENSOR_USAGE });
    this.#buffers.set(input, buffer);
    return buffer;
  }
}

/** Replicates a number over a word. */
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
      expected: `at most ${capacity} rows, as nMax of its contract says`,
      found: `${rows}`,
      remedy: 'raise nMax in the contract to the most rows that a run writes',
    },
  ]);
