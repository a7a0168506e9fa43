import { constants, noteWishes } from '../generated/shaders.js';
import { rareKernelOf, type ComputeKernel, type Resources } from '../gpu/kernel.js';
import { cullGroups } from './cull.js';

/** Which pages of a streamed scene a view asks for. */
export class NoteWishesStage {
  readonly #kernel: ComputeKernel<typeof noteWishes>;

  constructor(device: GPUDevice) {
    this.#kernel = rareKernelOf(device, noteWishes);
  }

  /** Of a streamed scene: makes the pipeline. */
  prepare(): void {
    this.#kernel.prepare();
  }

  bind(resources: Resources<typeof noteWishes>): GPUBindGroup {
    return this.#kernel.bind(resources);
  }

  record(pass: GPUComputePassEncoder, bindings: GPUBindGroup, splatCount: number): void {
    this.#kernel.dispatch(pass, bindings, Math.ceil(cullGroups(splatCount) / constants.WISH_THREADS));
  }
}
