import { plan } from '../generated/shaders.js';
import { kernelOf, type ComputeKernel, type Resources } from '../gpu/kernel.js';

/** Indirect arguments of the later stages from the counts of the earlier ones. */
export class PlanStage {
  readonly #kernel: ComputeKernel<typeof plan>;

  constructor(device: GPUDevice) {
    this.#kernel = kernelOf(device, plan);
  }

  bind(resources: Resources<typeof plan>): GPUBindGroup {
    return this.#kernel.bind(resources);
  }

  record(pass: GPUComputePassEncoder, bindings: GPUBindGroup): void {
    this.#kernel.dispatch(pass, bindings, 1);
  }
}
