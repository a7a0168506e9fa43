import { detailAllow, detailCount } from '../generated/budget-shaders.js';
import { constants } from '../generated/shaders.js';
import { kernelOf, type ComputeKernel, type Resources } from '../gpu/kernel.js';
import { cullGroups } from './cull.js';

/** How far chunks may be off on screen so that a frame looks at no more splats than it may. */
export class DetailBudgetStage {
  readonly #count: ComputeKernel<typeof detailCount>;
  readonly #allow: ComputeKernel<typeof detailAllow>;

  constructor(device: GPUDevice) {
    this.#count = kernelOf(device, detailCount);
    this.#allow = kernelOf(device, detailAllow);
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
