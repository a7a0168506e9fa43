import { orderKeys } from '../generated/shaders.js';
import { kernelOf, type ComputeKernel, type Resources } from '../gpu/kernel.js';
import { cullGroups } from './cull.js';

/** Keys that order all splats of a page by depth. */
export class OrderKeysStage {
  readonly #kernel: ComputeKernel<typeof orderKeys>;

  constructor(device: GPUDevice) {
    this.#kernel = kernelOf(device, orderKeys);
  }

  bind(resources: Resources<typeof orderKeys>): GPUBindGroup {
    return this.#kernel.bind(resources);
  }

  record(pass: GPUComputePassEncoder, bindings: GPUBindGroup, splatCount: number): void {
    this.#kernel.dispatch(pass, bindings, cullGroups(splatCount));
  }
}
