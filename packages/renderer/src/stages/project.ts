import { constants, type project } from '../generated/shaders.js';
import { PACKED, type GeometryReading } from '../geometry-reading.js';
import { kernelOf, type ComputeKernel, type Resources } from '../gpu/kernel.js';

/** Screen ellipse, colour and depth key of the survivors of a page. */
export class ProjectStage {
  readonly #kernel: ComputeKernel<GeometryReading['project']>;

  constructor(device: GPUDevice, reading = PACKED) {
    this.#kernel = kernelOf(device, reading.project);
  }

  bind(resources: Resources<typeof project>): GPUBindGroup {
    return this.#kernel.bind(resources);
  }

  /** @param most splats that may be visible: groups beyond those that are end at once */
  record(pass: GPUComputePassEncoder, bindings: GPUBindGroup, most: number): void {
    this.#kernel.dispatch(pass, bindings, Math.ceil(most / constants.PROJECT_GROUP));
  }
}
