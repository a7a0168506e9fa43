import { moveSlots } from '../generated/streamed-shaders.js';
import { kernelOf, type ComputeKernel, type Resources } from '../gpu/kernel.js';

/** Moves the splats of slots: see shaders/move_slots.wgsl. */
export class MoveSlotsStage {
  readonly #kernel: ComputeKernel<typeof moveSlots>;

  constructor(device: GPUDevice) {
    this.#kernel = kernelOf(device, moveSlots).prepare();
  }

  bind(resources: Resources<typeof moveSlots>): GPUBindGroup {
    return this.#kernel.bind(resources);
  }

  record(pass: GPUComputePassEncoder, bindings: GPUBindGroup, slots: number): void {
    this.#kernel.dispatchGrid(pass, bindings, slots, 1);
  }
}
