import { loadModule, type ShDegree, type Vector3 } from '@gaussian-splat/core';
import type { GaussianPage, GaussianScene } from './gaussian-scene.js';
import { constants } from './generated/shaders.js';
import { BUFFER_USAGE } from './gpu/kernel.js';
import { GpuMemory, withMemoryCheck } from './gpu/memory.js';
import { turn } from './gpu/page-thread.js';
import { MemoryLedger, type Reservation } from './memory-ledger.js';
import { DETAIL_NUMBERS } from './levels/chunk-detail.js';
import { type PackedGaussians } from './pack/pack.js';
import type { DetailBudget } from './stages/detail-budget.js';
import { CHUNK_NUMBERS, GEOMETRY_WORDS, type ShPrecision, shWords } from './pack/words.js';

export interface UploadOptions {
  /** Bytes of GPU memory that the scene may take; default no limit but the device's. */
  readonly memoryBudget?: number;
}

/** Gaussians on the GPU, ready for any {@link Viewpoint} of the same device. */
export class GaussianBuffers implements GaussianScene {
  /** Splats of all levels of detail together. */
  readonly count: number;
  readonly shDegree: ShDegree;
  readonly shPrecision: ShPrecision;
  /** True if the scene was trained with opacity compensation; the renderer follows. */
  readonly antialiased: boolean;
  /** Variance in px² of the screen-space low-pass filter that the scene was trained with; undefined is the classic 0.3. */
  readonly filterVariance?: number | undefined;
  /** World position, in float64, that the positions on the GPU are relative to. */
  readonly origin: Vector3;
  /** Splats of the finest level, if there are levels of detail. */
  readonly leafCount: number | undefined;
  /** Splats of the source that were left out because a value was not usable. */
  readonly droppedCount: number;
  readonly pages: readonly GaussianPage[];
  readonly version = 0;
  /** If there are levels of detail. */
  readonly detailBudget: DetailBudget | undefined;
  readonly #memory: GpuMemory;
  readonly #reservation: Reservation;
  readonly #contents: readonly Content[];

  private constructor(device: GPUDevice, packed: PackedGaussians, memoryBudget?: number, budget?: DetailBudget) {
    this.detailBudget = budget;
    ({
      count: this.count,
      shDegree: this.shDegree,
      shPrecision: this.shPrecision,
      antialiased: this.antialiased,
      filterVariance: this.filterVariance,
      origin: this.origin,
      droppedCount: this.droppedCount,
      leafCount: this.leafCount,
    } = packed);
    const { geometry, sh, chunks, details } = packed;
    const bytes = [geometry, sh, chunks, details].reduce((sum, part) => sum + (part?.byteLength ?? 0), 0);
    this.#reservation = MemoryLedger.of(device).reserve(whatOf(packed), bytes, memoryBudget);
    this.#memory = new GpuMemory(device);
    try {
      ({ pages: this.pages, contents: this.#contents } = makePages(device, packed, this.#memory));
    } catch (error) {
      this.destroy();
      throw error;
    }
  }

  /**
   * Copies packed Gaussians to the GPU, in as many pages as the device's limits ask for, and in portions that leave the thread time for other things.
   * @throws GaussianSplatError `out-of-memory/budget`, before anything is allocated, if the scene is larger than `memoryBudget` or than what the
   * device's {@link MemoryLedger} has left for all scenes; `out-of-memory/allocation` if the device has no room; `network/unreachable` if the code for levels of detail
   * cannot be loaded.
   */
  static async upload(
    device: GPUDevice,
    packed: PackedGaussians,
    { memoryBudget }: UploadOptions = {},
  ): Promise<GaussianBuffers> {
    const budget = packed.details && (await budgetOn(device));
    const make = (): GaussianBuffers => new GaussianBuffers(device, packed, memoryBudget, budget);
    const made = await withMemoryCheck(device, whatOf(packed), make);
    await writeInTurns(device, made.#contents);
    return made;
  }

  /** Bytes of GPU memory held. */
  get byteLength(): number {
    return this.#memory.byteLength;
  }

  destroy(): void {
    this.#reservation.release();
    this.#memory.destroy();
  }
}

/** Few scenes have levels of detail. */
const budgetOn = (device: GPUDevice): Promise<DetailBudget> =>
  loadModule('the code for budgets of splats', async () => {
    const { detailBudgetOn } = await import('./stages/detail-budget.js');
    return detailBudgetOn(device);
  });

const whatOf = ({ count }: PackedGaussians): string => `scene of ${count} splats`;

/** What a buffer is to hold. */
interface Content {
  readonly buffer: GPUBuffer;
  readonly words: Uint32Array<ArrayBuffer>;
}

function makePages(
  device: GPUDevice,
  packed: PackedGaussians,
  memory: GpuMemory,
): { pages: GaussianPage[]; contents: Content[] } {
  const shStride = shWords(packed.shDegree, packed.shPrecision);
  const chunks = new Uint32Array(packed.chunks.buffer, packed.chunks.byteOffset, packed.chunks.length);
  const capacity = pageCapacity(device, 4 * Math.max(GEOMETRY_WORDS, shStride));
  const usage = BUFFER_USAGE.storage | BUFFER_USAGE.copyDestination | BUFFER_USAGE.copySource;
  const details =
    packed.details && new Uint32Array(packed.details.buffer, packed.details.byteOffset, packed.details.length);
  const pages: GaussianPage[] = [];
  const contents: Content[] = [];
  for (let first = 0; first < packed.count; first += capacity) {
    const end = Math.min(first + capacity, packed.count);
    const part = (label: string, words: Uint32Array, stride: number, from = first, to = end): GPUBuffer => {
      const buffer = memory.buffer(label, 4 * stride * (to - from), usage);
      contents.push({ buffer, words: words.subarray(stride * from, stride * to) as Uint32Array<ArrayBuffer> });
      return buffer;
    };
    const [firstChunk, endChunk] = [first / constants.CULL_GROUP, Math.ceil(end / constants.CULL_GROUP)];
    pages.push({
      count: end - first,
      geometry: part('gs.gaussians.geometry', packed.geometry, GEOMETRY_WORDS),
      sh: part('gs.gaussians.sh', packed.sh, shStride),
      chunks: part('gs.gaussians.chunks', chunks, CHUNK_NUMBERS, firstChunk, endChunk),
      details: details && part('gs.gaussians.details', details, DETAIL_NUMBERS, firstChunk, endChunk),
    });
  }
  return { pages, contents };
}

/** Words that are handed to the GPU at once: 4 MB, some milliseconds. */
const WORDS_AT_ONCE = 1 << 20;

async function writeInTurns({ queue }: GPUDevice, contents: readonly Content[]): Promise<void> {
  let left = WORDS_AT_ONCE;
  for (const { buffer, words } of contents)
    for (let first = 0; first < words.length;) {
      if (left === 0) {
        await turn();
        left = WORDS_AT_ONCE;
      }
      const count = Math.min(left, words.length - first);
      queue.writeBuffer(buffer, 4 * first, words, first, count);
      [first, left] = [first + count, left - count];
    }
}

/** Splats in a page of so many bytes a splat: what the limits allow, in whole chunks, of which one dispatch takes a row. */
export function pageCapacity(device: GPUDevice, bytesPerSplat: number): number {
  const { maxBufferSize, maxStorageBufferBindingSize } = device.limits;
  const splats = Math.floor(Math.min(maxBufferSize, maxStorageBufferBindingSize) / bytesPerSplat);
  return Math.min(Math.floor(splats / constants.CULL_GROUP), constants.MAX_GROUPS_X) * constants.CULL_GROUP;
}
