import { ingest } from '../generated/live-shaders.js';
import { kernelOf, type ComputeKernel, type Resources } from '../gpu/kernel.js';
import { cullGroups } from './cull.js';

/** Tensors of a generator to packed Gaussians of a page. */
export class IngestStage {
  readonly #kernel: ComputeKernel<typeof ingest>;

  constructor(device: GPUDevice) {
    this.#kernel = kernelOf(device, ingest);
  }

  bind(resources: Resources<typeof ingest>): GPUBindGroup {
    return this.#kernel.bind(resources);
  }

  /** @param pageRows splats for which the page has room */
  record(pass: GPUComputePassEncoder, bindings: GPUBindGroup, pageRows: number): void {
    this.#kernel.dispatch(pass, bindings, cullGroups(pageRows));
  }
}
