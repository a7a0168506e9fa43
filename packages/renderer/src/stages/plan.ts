import { plan, planSerial } from '../generated/shaders.js';
import { kernelOf, type ComputeKernel, type Resources } from '../gpu/kernel.js';

/**
 * How a stage shares its work: `parallel`, one thread for each item, as GPUs want it; `serial`, a run of items for each thread and no
 * barriers, for adapters that are a processor in disguise (SwiftShader, llvmpipe, WARP).
 */
export type Threads = 'parallel' | 'serial';

const VECTOR_BYTES = 16;

/** Bytes of a buffer for the prefix sums of `length` numbers and their total: whole vectors of four. */
export const scanBytes = (length: number): number => VECTOR_BYTES * Math.ceil((4 * (length + 1)) / VECTOR_BYTES);

/**
 * Makes counts their exclusive prefix sums, in place in a buffer of {@link scanBytes} with the total behind the last, and writes the `Plan` of the later stages.
 */
export class PlanStage {
  readonly #kernel: ComputeKernel<typeof plan> | ComputeKernel<typeof planSerial>;

  constructor(device: GPUDevice, threads: Threads = 'parallel') {
    this.#kernel = threads === 'serial' ? kernelOf(device, planSerial) : kernelOf(device, plan);
  }

  bind(resources: Resources<typeof plan>): GPUBindGroup {
    return this.#kernel.bind(resources);
  }

  record(pass: GPUComputePassEncoder, bindings: GPUBindGroup): void {
    this.#kernel.dispatch(pass, bindings, 1);
  }
}
