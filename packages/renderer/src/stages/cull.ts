import { constants, cullChunks, type cull } from '../generated/shaders.js';
import { PACKED, type GeometryReading } from '../geometry-reading.js';
import { kernelOf, type ComputeKernel, type Resources } from '../gpu/kernel.js';
import type { Threads } from './plan.js';

/** In which share each chunk of a page is drawn: 0 where it may hold no visible splat. */
export class CullChunksStage {
  readonly #kernel: ComputeKernel<typeof cullChunks>;

  constructor(device: GPUDevice) {
    this.#kernel = kernelOf(device, cullChunks);
  }

  bind(resources: Resources<typeof cullChunks>): GPUBindGroup {
    return this.#kernel.bind(resources);
  }

  record(pass: GPUComputePassEncoder, bindings: GPUBindGroup, splatCount: number): void {
    this.#kernel.dispatch(pass, bindings, Math.ceil(cullGroups(splatCount) / constants.CHUNK_THREADS));
  }
}

/** Which splats of the chunks that are drawn paint anything, and how many of each group of 256. */
export class CullStage {
  readonly #kernel: ComputeKernel<GeometryReading['cull'] | GeometryReading['cullSerial']>;

  constructor(device: GPUDevice, threads: Threads = 'parallel', reading = PACKED) {
    this.#kernel = kernelOf(device, reading[threads === 'serial' ? 'cullSerial' : 'cull']);
  }

  bind(resources: Resources<typeof cull>): GPUBindGroup {
    return this.#kernel.bind(resources);
  }

  record(pass: GPUComputePassEncoder, bindings: GPUBindGroup, splatCount: number): void {
    this.#kernel.dispatch(pass, bindings, cullGroups(splatCount));
  }
}

/** Chunks of a page of `splatCount` splats; each is one workgroup of `cull`. */
export function cullGroups(splatCount: number): number {
  return Math.ceil(splatCount / constants.CULL_GROUP);
}
