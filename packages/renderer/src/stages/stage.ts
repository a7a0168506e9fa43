import { compact, constants, cullChunks, plan, planSerial } from '../generated/shaders.js';
import { PACKED, type GeometryReading, type Like } from '../geometry-reading.js';
import { kernelOf, type ComputeKernel, type Resources, type ShaderDescription } from '../gpu/kernel.js';

/**
 * How a stage shares its work: `parallel`, one thread for each item, as GPUs want it; `serial`, a run of items for each thread and no
 * barriers, for adapters that are a processor in disguise (SwiftShader, llvmpipe, WARP).
 */
export type Threads = 'parallel' | 'serial';

/** A stage of one kernel. */
export class Stage<S extends ShaderDescription> {
  readonly #kernel: ComputeKernel<S>;
  readonly #groupItems: number;

  /** @param groupItems items of one workgroup */
  constructor(device: GPUDevice, shader: S, groupItems = 1) {
    this.#kernel = kernelOf(device, shader);
    this.#groupItems = groupItems;
  }

  bind(resources: Resources<S>): GPUBindGroup {
    return this.#kernel.bind(resources);
  }

  /** @param items that there may be: groups beyond those that are end at once */
  record(pass: GPUComputePassEncoder, bindings: GPUBindGroup, items = 1): void {
    this.#kernel.dispatch(pass, bindings, Math.ceil(items / this.#groupItems));
  }
}

const { CHUNK_THREADS, CULL_GROUP, PROJECT_GROUP } = constants;

/** Chunks of a page of `splatCount` splats; each is one workgroup of `cull`. */
export const cullGroups = (splatCount: number): number => Math.ceil(splatCount / CULL_GROUP);

/** In which share each chunk of a page is drawn: 0 where it may hold no visible splat. */
export const cullChunksStage = (
  device: GPUDevice,
  { cullChunks: own = cullChunks }: GeometryReading = PACKED,
): Stage<Like<typeof cullChunks>> => new Stage<Like<typeof cullChunks>>(device, own, CULL_GROUP * CHUNK_THREADS);

/** Which splats of the chunks that are drawn paint anything, and how many of each group of 256. */
export const cullStage = (
  device: GPUDevice,
  threads: Threads = 'parallel',
  reading = PACKED,
): Stage<GeometryReading['cull']> =>
  new Stage(device, reading[threads === 'serial' ? 'cullSerial' : 'cull'], CULL_GROUP);

/**
 * Makes counts their exclusive prefix sums, in place in a buffer of {@link scanBytes} with the total behind the last, and writes the `Plan` of the later stages.
 */
export const planStage = (device: GPUDevice, threads: Threads = 'parallel'): Stage<typeof plan | typeof planSerial> =>
  new Stage(device, threads === 'serial' ? planSerial : plan);

/** Lists the survivors of a page in the file's order. */
export const compactStage = (device: GPUDevice): Stage<typeof compact> => new Stage(device, compact, CULL_GROUP);

/** Screen ellipse, color and depth key of the survivors of a page. */
export const projectStage = (device: GPUDevice, reading = PACKED): Stage<GeometryReading['project']> =>
  new Stage(device, reading.project, PROJECT_GROUP);

const VECTOR_BYTES = 16;

/** Bytes of a buffer for the prefix sums of `length` numbers and their total: whole vectors of four. */
export const scanBytes = (length: number): number => VECTOR_BYTES * Math.ceil((4 * (length + 1)) / VECTOR_BYTES);
