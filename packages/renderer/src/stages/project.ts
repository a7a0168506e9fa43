import { project } from '../generated/shaders.js';
import { kernelOf, type ComputeKernel, type Resources } from '../gpu/kernel.js';
import { planOffsets } from '../scratch.js';

/** Screen ellipse, colour and depth key of the survivors of a page. */
export class ProjectStage {
  readonly #kernel: ComputeKernel<typeof project>;

  constructor(device: GPUDevice) {
    this.#kernel = kernelOf(device, project);
  }

  bind(resources: Resources<typeof project>): GPUBindGroup {
    return this.#kernel.bind(resources);
  }

  record(pass: GPUComputePassEncoder, bindings: GPUBindGroup, plan: GPUBuffer, page: number): void {
    this.#kernel.dispatchIndirect(pass, bindings, plan, planOffsets.project(page));
  }
}
