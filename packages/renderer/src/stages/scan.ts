import { scan, scanSerial } from '../generated/shaders.js';
import { kernelOf, type ComputeKernel, type Resources } from '../gpu/kernel.js';
import type { Threads } from './threads.js';

const VECTOR_BYTES = 16;

/** Bytes of a buffer for the prefix sums of `length` numbers and their total: whole vectors of four. */
export const scanBytes = (length: number): number => VECTOR_BYTES * Math.ceil((4 * (length + 1)) / VECTOR_BYTES);

/** Exclusive prefix sums of an array in place, in a buffer of {@link scanBytes}; the total goes behind its last element. */
export class ScanStage {
  readonly #kernel: ComputeKernel<typeof scan> | ComputeKernel<typeof scanSerial>;

  constructor(device: GPUDevice, threads: Threads = 'parallel') {
    this.#kernel = threads === 'serial' ? kernelOf(device, scanSerial) : kernelOf(device, scan);
  }

  bind(resources: Resources<typeof scan>): GPUBindGroup {
    return this.#kernel.bind(resources);
  }

  record(pass: GPUComputePassEncoder, bindings: GPUBindGroup): void {
    this.#kernel.dispatch(pass, bindings, 1);
  }
}
