import type { orderKeys } from '../generated/shaders.js';
import { PACKED, type GeometryReading } from '../geometry-reading.js';
import { kernelOf, type ComputeKernel, type Resources } from '../gpu/kernel.js';
import { cullGroups } from './cull.js';

/** Keys that order all splats of a page by depth. */
export class OrderKeysStage {
  readonly #kernel: ComputeKernel<GeometryReading['orderKeys']>;

  constructor(device: GPUDevice, reading = PACKED) {
    this.#kernel = kernelOf(device, reading.orderKeys);
  }

  bind(resources: Resources<typeof orderKeys>): GPUBindGroup {
    return this.#kernel.bind(resources);
  }

  record(pass: GPUComputePassEncoder, bindings: GPUBindGroup, splatCount: number): void {
    this.#kernel.dispatch(pass, bindings, cullGroups(splatCount));
  }
}
