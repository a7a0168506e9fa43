import { moveQuantizedSlots } from '../generated/quantized-shaders.js';
import { moveSlots } from '../generated/streamed-shaders.js';
import { kernelOf, type ComputeKernel, type Resources } from '../gpu/kernel.js';

/** Moves the splats of slots: see shaders/move_slots.wgsl, and for quantized geometry shaders/move_quantized_slots.wgsl. */
export class MoveSlotsStage {
  readonly #kernel: ComputeKernel<typeof moveSlots | typeof moveQuantizedSlots>;

  constructor(device: GPUDevice, geometry?: 'quantized') {
    this.#kernel = kernelOf(device, geometry ? moveQuantizedSlots : moveSlots);
  }

  bind(resources: Resources<typeof moveSlots>): GPUBindGroup {
    return this.#kernel.bind(resources);
  }

  record(pass: GPUComputePassEncoder, bindings: GPUBindGroup, slots: number): void {
    this.#kernel.dispatchGrid(pass, bindings, slots, 1);
  }
}
