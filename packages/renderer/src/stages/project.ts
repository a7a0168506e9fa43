import type { project } from '../generated/shaders.js';
import { PACKED, type GeometryReading } from '../geometry-reading.js';
import { kernelOf, type ComputeKernel, type Resources } from '../gpu/kernel.js';
import { planOffsets } from '../scratch.js';

/** Screen ellipse, colour and depth key of the survivors of a page. */
export class ProjectStage {
  readonly #kernel: ComputeKernel<GeometryReading['project']>;

  constructor(device: GPUDevice, reading = PACKED) {
    this.#kernel = kernelOf(device, reading.project);
  }

  bind(resources: Resources<typeof project>): GPUBindGroup {
    return this.#kernel.bind(resources);
  }

  record(pass: GPUComputePassEncoder, bindings: GPUBindGroup, plan: GPUBuffer, page: number): void {
    this.#kernel.dispatchIndirect(pass, bindings, plan, planOffsets.project(page));
  }
}
