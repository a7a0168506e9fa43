import { constants, detailAllow, detailCount } from '../generated/shaders.js';
import { rareKernelOf, type ComputeKernel, type Resources } from '../gpu/kernel.js';
import { cullGroups } from './cull.js';

/** How far chunks may be off on screen so that a frame looks at no more splats than it may. */
export class DetailBudgetStage {
  readonly #count: ComputeKernel<typeof detailCount>;
  readonly #allow: ComputeKernel<typeof detailAllow>;

  constructor(device: GPUDevice) {
    this.#count = rareKernelOf(device, detailCount);
    this.#allow = rareKernelOf(device, detailAllow);
  }

  /** Of a scene with levels of detail: makes the pipelines. */
  prepare(): void {
    this.#count.prepare();
    this.#allow.prepare();
  }

  bindCount(resources: Resources<typeof detailCount>): GPUBindGroup {
    return this.#count.bind(resources);
  }

  bindAllow(resources: Resources<typeof detailAllow>): GPUBindGroup {
    return this.#allow.bind(resources);
  }

  /** Counts a page; `detail_counts` must be nothing before the first. */
  recordCount(pass: GPUComputePassEncoder, bindings: GPUBindGroup, splatCount: number): void {
    this.#count.dispatch(pass, bindings, Math.ceil(cullGroups(splatCount) / constants.DETAIL_THREADS));
  }

  recordAllow(pass: GPUComputePassEncoder, bindings: GPUBindGroup): void {
    this.#allow.dispatch(pass, bindings, 1);
  }
}
