import { constants, cull } from '../generated/shaders.js';
import { kernelOf, type ComputeKernel, type Resources } from '../gpu/kernel.js';

/** Which splats of a page paint anything, and how many of each group of 256. */
export class CullStage {
  readonly #kernel: ComputeKernel<typeof cull>;

  constructor(device: GPUDevice) {
    this.#kernel = kernelOf(device, cull);
  }

  bind(resources: Resources<typeof cull>): GPUBindGroup {
    return this.#kernel.bind(resources);
  }

  record(pass: GPUComputePassEncoder, bindings: GPUBindGroup, splatCount: number): void {
    this.#kernel.dispatch(pass, bindings, cullGroups(splatCount));
  }
}

/** Workgroups that a page of `splatCount` splats takes. */
export function cullGroups(splatCount: number): number {
  return Math.ceil(splatCount / constants.CULL_GROUP);
}
