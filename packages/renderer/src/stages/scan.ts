import { scan } from '../generated/shaders.js';
import { kernelOf, type ComputeKernel, type Resources } from '../gpu/kernel.js';

/** Exclusive prefix sums of an array in place; the total goes behind its last element. */
export class ScanStage {
  readonly #kernel: ComputeKernel<typeof scan>;

  constructor(device: GPUDevice) {
    this.#kernel = kernelOf(device, scan);
  }

  bind(resources: Resources<typeof scan>): GPUBindGroup {
    return this.#kernel.bind(resources);
  }

  record(pass: GPUComputePassEncoder, bindings: GPUBindGroup): void {
    this.#kernel.dispatch(pass, bindings, 1);
  }
}
