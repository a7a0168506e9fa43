import { compact } from '../generated/shaders.js';
import { cullGroups } from './cull.js';
import { kernelOf, type ComputeKernel, type Resources } from '../gpu/kernel.js';

/** Lists the survivors of a page in the file's order. */
export class CompactStage {
  readonly #kernel: ComputeKernel<typeof compact>;

  constructor(device: GPUDevice) {
    this.#kernel = kernelOf(device, compact);
  }

  bind(resources: Resources<typeof compact>): GPUBindGroup {
    return this.#kernel.bind(resources);
  }

  record(pass: GPUComputePassEncoder, bindings: GPUBindGroup, splatCount: number): void {
    this.#kernel.dispatch(pass, bindings, cullGroups(splatCount));
  }
}
