import { compact } from '../generated/shaders.js';
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

  /** @param chunkArgs indirect arguments as `CullChunksStage` leaves them, three words a page */
  record(pass: GPUComputePassEncoder, bindings: GPUBindGroup, chunkArgs: GPUBuffer, page: number): void {
    this.#kernel.dispatchIndirect(pass, bindings, chunkArgs, 12 * page);
  }
}
