import { constants } from '../generated/shaders.js';
import { noteWishes } from '../generated/streamed-shaders.js';
import { kernelOf, type ComputeKernel, type Resources } from '../gpu/kernel.js';
import { cullGroups } from './cull.js';

/** Which pages of a streamed scene a view asks for. */
export class NoteWishesStage {
  readonly #kernel: ComputeKernel<typeof noteWishes>;

  constructor(device: GPUDevice) {
    this.#kernel = kernelOf(device, noteWishes);
  }

  bind(resources: Resources<typeof noteWishes>): GPUBindGroup {
    return this.#kernel.bind(resources);
  }

  record(pass: GPUComputePassEncoder, bindings: GPUBindGroup, splatCount: number): void {
    this.#kernel.dispatch(pass, bindings, Math.ceil(cullGroups(splatCount) / constants.WISH_THREADS));
  }
}
