import { loadModule } from '@gaussian-splat/core';
import type { GaussianBlock } from './gaussian-scene.js';
import { constants } from './generated/shaders.js';
import { BUFFER_USAGE } from './gpu/kernel.js';
import { type GpuMemory, withMemoryCheck } from './gpu/memory.js';
import { DETAIL_NUMBERS } from './levels/chunk-detail.js';
import type { PackedGaussians, PackedHead } from './pack/pack.js';
import { SceneBuffers } from './scene-buffers.js';
import type { DetailBudget } from './stages/detail-budget.js';
import { CHUNK_NUMBERS, GEOMETRY_WORDS, shWords } from './pack/words.js';

export interface UploadOptions {
  /** Upper limit of the GPU memory of the scene in bytes; default: no limit but the device's. */
  readonly memoryBudget?: number | undefined;
  /** Whether the device's {@link MemoryLedger} counts the scene; default true. It does not count scenes of the self-test. */
  readonly isCounted?: boolean;
}

/** A portion of packed Gaussians, from splat `start` on. */
export type PackedPortion = Partial<Pick<PackedGaussians, 'geometry' | 'sh' | 'chunks' | 'details'>> & {
  /** Index of the first splat of the portion; a multiple of 256 for `chunks` and `details`. Default 0. */
  readonly start?: number;
};

/** Number of words uploaded in one step: 4 MB, a few milliseconds. Two steps may be in transit. */
const WORDS_AT_ONCE = 1 << 20;

/** Gaussians on the GPU, ready for any {@link Viewpoint} of the same device. */
export class GaussianBuffers extends SceneBuffers {
  /** Number of splats of the finest level; undefined without levels of detail. */
  readonly leafCount: number | undefined;
  /** Number of splats of the source that were dropped because of an unusable value. */
  readonly droppedCount: number;
  readonly blocks: readonly GaussianBlock[];
  readonly version = 0;
  /** Stages that keep frames within a splat budget; undefined without levels of detail. */
  readonly detailBudget: DetailBudget | undefined;
  readonly #queue: GPUQueue;
  #isDestroyed = false;
  /** Number of words that {@link write} may still upload in this step. */
  #left = WORDS_AT_ONCE;
  /** Resolves when the GPU has processed all steps before the last one. */
  #taken: Promise<undefined> | undefined;

  private constructor(device: GPUDevice, memory: GpuMemory, packed: SceneSize, budget?: DetailBudget) {
    super(memory, packed, packed.count);
    this.detailBudget = budget;
    this.#queue = device.queue;
    ({ droppedCount: this.droppedCount, leafCount: this.leafCount } = packed);
    this.blocks = makeBlocks(device, packed, memory);
  }

  /**
   * Uploads packed Gaussians to the GPU, in as many blocks as the limits of the device require. The upload is divided
   * into portions, so that the thread can run other tasks between them.
   * @throws GaussianSplatError `out-of-memory/budget`, before anything is allocated, if the scene is larger than
   * `memoryBudget` or than the rest of the device's {@link MemoryLedger}; `out-of-memory/allocation` if the device has
   * too little memory; `network/unreachable` if the code for levels of detail cannot be loaded.
   */
  static async upload(
    device: GPUDevice,
    packed: PackedGaussians,
    options: UploadOptions = {},
  ): Promise<GaussianBuffers> {
    const made = await GaussianBuffers.allocate(device, packed, options, packed.details && (await budgetOn(device)));
    await made.write(packed);
    return made;
  }

  /**
   * Allocates the buffers of a scene whose content arrives in portions: see {@link write}. Rejects as {@link upload}
   * does.
   */
  static allocate(
    device: GPUDevice,
    packed: SceneSize,
    { memoryBudget, isCounted = true }: UploadOptions = {},
    budget?: DetailBudget,
  ): Promise<GaussianBuffers> {
    return withMemoryCheck(device, whatOf(packed), (memory) => {
      if (isCounted) memory.reserve(whatOf(packed), sceneBytes(packed), memoryBudget);
      return new GaussianBuffers(device, memory, packed, budget);
    });
  }

  /** Copies a portion to the GPU, with waits: browsers block the thread if more is in transit than a buffer can hold. */
  async write(portion: PackedPortion): Promise<void> {
    for (const { buffer, offset, words } of this.#contentsOf(portion))
      for (let first = 0; first < words.length;) {
        if (this.#left === 0) {
          const before = this.#taken;
          this.#taken = this.#queue.onSubmittedWorkDone().catch(() => undefined);
          await before;
          if (this.#isDestroyed) return;
          this.#left = WORDS_AT_ONCE;
        }
        const count = Math.min(this.#left, words.length - first);
        this.#queue.writeBuffer(buffer, offset + 4 * first, words, first, count);
        [first, this.#left] = [first + count, this.#left - count];
      }
  }

  #contentsOf({ start = 0, geometry, sh, chunks, details }: PackedPortion): Content[] {
    const { blocks } = this;
    const shStride = shWords(this.shDegree, this.shPrecision);
    const place = (
      name: 'geometry' | 'sh' | 'chunks' | 'details',
      values: Uint32Array | Float32Array | undefined,
      stride: number,
      ofChunks: 1 | typeof constants.CULL_GROUP = 1,
    ): Content[] => {
      const contents: Content[] = [];
      const capacity = Math.ceil((blocks[0]?.count ?? 0) / ofChunks);
      for (let at = 0, first = start / ofChunks; at < (values?.length ?? 0);) {
        const page = Math.floor(first / capacity);
        const words = wordsOf(values!, at, stride * ((page + 1) * capacity - first));
        contents.push({ buffer: blocks[page][name]!, offset: 4 * stride * (first - page * capacity), words });
        at += words.length;
        first += words.length / stride;
      }
      return contents;
    };
    return [
      ...place('geometry', geometry, GEOMETRY_WORDS),
      ...place('sh', sh, shStride),
      ...place('chunks', chunks, CHUNK_NUMBERS, constants.CULL_GROUP),
      ...place('details', details, DETAIL_NUMBERS, constants.CULL_GROUP),
    ];
  }

  override destroy(): void {
    this.#isDestroyed = true;
    super.destroy();
  }
}

/** Loads the stages for splat budgets on demand, because few scenes have levels of detail. */
const budgetOn = (device: GPUDevice): Promise<DetailBudget> =>
  loadModule('the code for budgets of splats', async () => {
    const { detailBudgetOn } = await import('./stages/detail-budget.js');
    return detailBudgetOn(device);
  });

const whatOf = ({ count }: PackedHead): string => `scene of ${count} splats`;

/** Words to write to a part of a buffer. */
interface Content {
  readonly buffer: GPUBuffer;
  /** Offset in the buffer in bytes. */
  readonly offset: number;
  readonly words: Uint32Array<ArrayBuffer>;
}

/** Returns at most `count` numbers of an array, from index `from` on, as a view of u32. */
function wordsOf(
  { buffer, byteOffset, length }: Uint32Array | Float32Array,
  from: number,
  count: number,
): Uint32Array<ArrayBuffer> {
  return new Uint32Array(buffer as ArrayBuffer, byteOffset + 4 * from, Math.min(count, length - from));
}

/** Properties that determine the size of a scene in bytes. */
type SceneSize = PackedHead & Pick<PackedGaussians, 'details'>;

/** Returns the GPU memory of a scene in bytes. */
export function sceneBytes({ count, shDegree, shPrecision, details }: SceneSize): number {
  const perChunk = CHUNK_NUMBERS + (details ? DETAIL_NUMBERS : 0);
  const words = GEOMETRY_WORDS + shWords(shDegree, shPrecision);
  return 4 * (words * count + perChunk * Math.ceil(count / constants.CULL_GROUP));
}

function makeBlocks(device: GPUDevice, packed: SceneSize, memory: GpuMemory): GaussianBlock[] {
  const shStride = shWords(packed.shDegree, packed.shPrecision);
  const capacity = pageCapacity(device, 4 * Math.max(GEOMETRY_WORDS, shStride));
  const usage = BUFFER_USAGE.storage | BUFFER_USAGE.copyDestination | BUFFER_USAGE.copySource;
  const blocks: GaussianBlock[] = [];
  for (let left = packed.count; left > 0; left -= capacity) {
    const count = Math.min(capacity, left);
    const chunks = Math.ceil(count / constants.CULL_GROUP);
    const part = (label: string, words: number): GPUBuffer => memory.buffer(`gs.gaussians.${label}`, 4 * words, usage);
    blocks.push({
      count,
      geometry: part('geometry', GEOMETRY_WORDS * count),
      sh: part('sh', shStride * count),
      chunks: part('chunks', CHUNK_NUMBERS * chunks),
      details: packed.details ? part('details', DETAIL_NUMBERS * chunks) : undefined,
    });
  }
  return blocks;
}

/**
 * Returns the maximum number of splats in a block: a multiple of 256 within the limits of the device, which one
 * dispatch row can process.
 */
export function pageCapacity(device: GPUDevice, bytesPerSplat: number): number {
  const { maxBufferSize, maxStorageBufferBindingSize } = device.limits;
  const splats = Math.floor(Math.min(maxBufferSize, maxStorageBufferBindingSize) / bytesPerSplat);
  return Math.min(Math.floor(splats / constants.CULL_GROUP), constants.MAX_GROUPS_X) * constants.CULL_GROUP;
}
