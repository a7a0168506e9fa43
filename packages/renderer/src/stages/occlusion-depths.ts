import { constants, occlusionDepths } from '../generated/shaders.js';
import { rareKernelOf, type ComputeKernel, type Resources } from '../gpu/kernel.js';

/** How far one sees in each tile and block of tiles, from how far one saw in the last frame. */
export class OcclusionDepthsStage {
  readonly #kernel: ComputeKernel<typeof occlusionDepths>;

  constructor(device: GPUDevice) {
    this.#kernel = rareKernelOf(device, occlusionDepths);
  }

  /** Of a renderer that leaves out what is hidden: makes the pipeline. */
  prepare(): void {
    this.#kernel.prepare();
  }

  bind(resources: Resources<typeof occlusionDepths>): GPUBindGroup {
    return this.#kernel.bind(resources);
  }

  record(pass: GPUComputePassEncoder, bindings: GPUBindGroup, [columns, rows]: readonly [number, number]): void {
    const { OCCLUSION_THREADS } = constants;
    this.#kernel.dispatchGrid(
      pass,
      bindings,
      Math.ceil(columns / OCCLUSION_THREADS),
      Math.ceil(rows / OCCLUSION_THREADS),
    );
  }
}
