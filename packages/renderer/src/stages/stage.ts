import { compact, constants, cullChunks, plan, planSerial } from '../generated/shaders.js';
import { PACKED, type GeometryReading, type Like } from '../geometry-reading.js';
import { kernelOf, type ComputeKernel, type Resources, type ShaderDescription } from '../gpu/kernel.js';

/**
 * Workgroup variant of a stage: `parallel`, one thread for each item, for GPUs; `serial`, a run of items for each
 * thread and no barriers, for software adapters (SwiftShader, llvmpipe, WARP).
 */
export type Threads = 'parallel' | 'serial';

/** A stage of one kernel. */
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

  /** @param items Maximum number of items: groups beyond the actual number end at once. */
  record(pass: GPUComputePassEncoder, bindings: GPUBindGroup, items = 1): void {
    this.#kernel.dispatch(pass, bindings, Math.ceil(items / this.#groupItems));
  }
}

const { CHUNK_THREADS, CULL_GROUP, PROJECT_GROUP } = constants;

/** Chunks of a block of `splatCount` splats; each is one workgroup of `cull`. */
export const cullGroups = (splatCount: number): number => Math.ceil(splatCount / CULL_GROUP);

/** Finds the LOD weight of each chunk of a block: 0 if it cannot hold a visible splat. */
export const cullChunksStage = (
  device: GPUDevice,
  { cullChunks: own = cullChunks }: GeometryReading = PACKED,
): Stage<Like<typeof cullChunks>> => new Stage<Like<typeof cullChunks>>(device, own, CULL_GROUP * CHUNK_THREADS);

/** Finds the visible splats of the chunks that are drawn, and their number in each group of 256. */
export const cullStage = (
  device: GPUDevice,
  threads: Threads = 'parallel',
  reading = PACKED,
): Stage<GeometryReading['cull']> =>
  new Stage(device, reading[threads === 'serial' ? 'cullSerial' : 'cull'], CULL_GROUP);

/**
 * Replaces counts by their exclusive prefix sums, in place in a buffer of {@link scanBytes} followed by the total, and
 * writes the `Plan` of the later stages.
 */
export const planStage = (device: GPUDevice, threads: Threads = 'parallel'): Stage<typeof plan | typeof planSerial> =>
  new Stage(device, threads === 'serial' ? planSerial : plan);

/** Lists the survivors of a block in the order of the file. */
export const compactStage = (device: GPUDevice): Stage<typeof compact> => new Stage(device, compact, CULL_GROUP);

/** Computes screen ellipse, color and depth key of the survivors of a block. */
export const projectStage = (device: GPUDevice, reading = PACKED): Stage<GeometryReading['project']> =>
  new Stage(device, reading.project, PROJECT_GROUP);

const VECTOR_BYTES = 16;

/** Bytes of a buffer for the prefix sums of `length` numbers and their total: whole vectors of four. */
export const scanBytes = (length: number): number => VECTOR_BYTES * Math.ceil((4 * (length + 1)) / VECTOR_BYTES);
