import { animate } from '../generated/clip-shaders.js';
import { kernelOf, type ComputeKernel, type Resources } from '../gpu/kernel.js';
import { cullGroups } from './cull.js';

/** Splats of a part of a clip to packed Gaussians, as they are in a frame. */
export class AnimateStage {
  readonly #kernel: ComputeKernel<typeof animate>;

  constructor(device: GPUDevice) {
    this.#kernel = kernelOf(device, animate);
  }

  bind(resources: Resources<typeof animate>): GPUBindGroup {
    return this.#kernel.bind(resources);
  }

  /** @param rows that are written, those included that paint nothing */
  record(pass: GPUComputePassEncoder, bindings: GPUBindGroup, rows: number): void {
    this.#kernel.dispatch(pass, bindings, cullGroups(rows));
  }
}
