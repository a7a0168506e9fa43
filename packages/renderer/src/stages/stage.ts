import { compact, constants, cullChunks, plan, planSerial } from '../generated/shaders.js';
import { PACKED, type GeometryReading, type Like } from '../geometry-reading.js';
import { kernelOf, type ComputeKernel, type Resources, type ShaderDescription } from '../gpu/kernel.js';

/**
 * Workgroup variant of a stage. `parallel` uses one thread for each item, for GPUs. `serial` uses one thread for a run
 * of items and no barriers, for software adapters (SwiftShader, llvmpipe, WARP).
 */
export type Threads = 'parallel' | 'serial';

/** A stage that dispatches one kernel. */
export class Stage<S extends ShaderDescription> {
  readonly #kernel: ComputeKernel<S>;
  readonly #groupItems: number;

  /** @param groupItems Number of items in one workgroup. */
  constructor(device: GPUDevice, shader: S, groupItems = 1) {
    this.#kernel = kernelOf(device, shader);
    this.#groupItems = groupItems;
  }

  bind(resources: Resources<S>): GPUBindGroup {
    return this.#kernel.bind(resources);
  }

  /**
   * Records a dispatch of the stage. @param items Maximum number of items; workgroups beyond the actual number end at
   * once.
   */
  record(pass: GPUComputePassEncoder, bindings: GPUBindGroup, items = 1): void {
    this.#kernel.dispatch(pass, bindings, Math.ceil(items / this.#groupItems));
  }
}

const { CHUNK_THREADS, CULL_GROUP, PROJECT_GROUP } = constants;

/** Returns the number of chunks in a block of `splatCount` splats. Each chunk is one workgroup of `cull`. */
export const cullGroups = (splatCount: number): number => Math.ceil(splatCount / CULL_GROUP);

/**
 * Returns the stage that finds the LOD weight of each chunk of a block; 0 if the chunk cannot contain a visible splat.
 */
export const cullChunksStage = (
  device: GPUDevice,
  { cullChunks: own = cullChunks }: GeometryReading = PACKED,
): Stage<Like<typeof cullChunks>> => new Stage<Like<typeof cullChunks>>(device, own, CULL_GROUP * CHUNK_THREADS);

/** Returns the stage that finds the visible splats of the drawn chunks, and their number in each group of 256. */
export const cullStage = (
  device: GPUDevice,
  threads: Threads = 'parallel',
  reading = PACKED,
): Stage<GeometryReading['cull']> =>
  new Stage(device, reading[threads === 'serial' ? 'cullSerial' : 'cull'], CULL_GROUP);

/**
 * Returns the stage that replaces counts by their exclusive prefix sums, followed by the total. It works in place in a
 * buffer of {@link scanBytes}, and writes the `Plan` for the later stages.
 */
export const planStage = (device: GPUDevice, threads: Threads = 'parallel'): Stage<typeof plan | typeof planSerial> =>
  new Stage(device, threads === 'serial' ? planSerial : plan);

/** Returns the stage that lists the survivors of a block in the order of the file. */
export const compactStage = (device: GPUDevice): Stage<typeof compact> => new Stage(device, compact, CULL_GROUP);

/** Returns the stage that computes the screen ellipse, color and depth key of the survivors of a block. */
export const projectStage = (device: GPUDevice, reading = PACKED): Stage<GeometryReading['project']> =>
  new Stage(device, reading.project, PROJECT_GROUP);

const VECTOR_BYTES = 16;

/** Returns the size in bytes of a buffer for the prefix sums of `length` numbers and their total, in whole vectors of four. */
export const scanBytes = (length: number): number => VECTOR_BYTES * Math.ceil((4 * (length + 1)) / VECTOR_BYTES);
