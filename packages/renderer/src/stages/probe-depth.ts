import { probeDepth } from '../generated/probe-shaders.js';
import { kernelOf, type ComputeKernel, type Resources } from '../gpu/kernel.js';

/** Opacity and depth under single points of the last frame; a workgroup a point. */
export class ProbeDepthStage {
  readonly #kernel: ComputeKernel<typeof probeDepth>;

  constructor(device: GPUDevice) {
    this.#kernel = kernelOf(device, probeDepth);
  }

  bind(resources: Resources<typeof probeDepth>): GPUBindGroup {
    return this.#kernel.bind(resources);
  }

  record(pass: GPUComputePassEncoder, bindings: GPUBindGroup, points: number): void {
    this.#kernel.dispatch(pass, bindings, points);
  }
}
