import { constants, layouts } from './generated/shaders.js';
import { BUFFER_USAGE } from './gpu/kernel.js';
import { BufferOwner, GpuMemory } from './gpu/memory.js';
import type { BlockTable } from './block-table.js';
import { scanBytes } from './stages/stage.js';

/** Number of elements of the buffers between the stages. */
export interface ScratchSize {
  /** Maximum number of visible splats in a frame. */
  readonly visible: number;
  /** Number of cull groups of all blocks; each has 256 splats. */
  readonly groups: number;
  /** Number of blocks. */
  readonly pages: number;
}

const { size: PLAN_SIZE } = layouts.Plan;
const { size: PAGE_PLAN_SIZE } = layouts.PagePlan;

/** Buffers between the stages of a frame. Their size does not depend on the camera. */
export class Scratch extends BufferOwner {
  /** Maximum number of visible splats in a frame. Survivors beyond it are not drawn, but counted in `Plan.overflow`. */
  readonly capacity: number;
  /** Weight of each chunk, followed by one f32: the error threshold of a budget in pixels. */
  chunkShares: GPUBuffer;
  /** Counts of splats for the splat budget of a frame: see shaders/shared/detail_counts.wgsl. */
  readonly detailCounts: GPUBuffer;
  /** One bit for each splat: whether it survives the cull. */
  visibleBits: GPUBuffer;
  /** Number of survivors of each cull group; later their exclusive prefix sums and the total. */
  groupOffsets: GPUBuffer;
  /** Statistics of the cull: unusable splats, depth range and coverage. See shaders/shared/cull_stats.wgsl. */
  readonly cullStats: GPUBuffer;
  plan: GPUBuffer;
  /** [blocks, 2] first group of each block and first group of the next block */
  pageRanges: GPUBuffer;
  /** Buffer with `PlanLimits` of plan.wgsl. */
  readonly limits: GPUBuffer;
  /** array<ProjectedSplat>, by slot */
  readonly splats: GPUBuffer;
  /** [visible] depth key of each slot. */
  readonly #keys: GPUBuffer;
  /** [visible] slots in the order of their keys; before the sort the indices of the survivors */
  readonly #order: GPUBuffer;
  #pingPong: readonly [GPUBuffer, GPUBuffer];
  /** [blocks of the sort, digits] number of keys with each digit */
  readonly digitCounts: GPUBuffer;
  readonly digitTotals: GPUBuffer;
  readonly #device: GPUDevice;
  readonly #kept = new Map<string, GPUBuffer>();

  /** @param pingPongBytes Minimum size of {@link pingPong}. */
  constructor(device: GPUDevice, { visible, groups, pages }: ScratchSize, pingPongBytes: number) {
    const memory = new GpuMemory(device);
    super(memory);
    this.#device = device;
    const { storage, uniform, copyDestination, copySource } = BUFFER_USAGE;
    this.capacity = visible;
    const buffer = (name: string, bytes: number): GPUBuffer =>
      memory.buffer(`gs.${name}`, bytes, storage | copySource | copyDestination);
    const perSplat = (name: string): GPUBuffer => buffer(name, 4 * this.capacity);
    try {
      const sizes = groupBytes(groups, pages);
      this.chunkShares = buffer('cull_chunks.shares', sizes.chunkShares);
      this.detailCounts = buffer('detail.counts', 4 * constants.DETAIL_COUNTS);
      this.visibleBits = buffer('cull.visible_bits', sizes.visibleBits);
      this.groupOffsets = buffer('cull.group_offsets', sizes.groupOffsets);
      this.cullStats = buffer('cull.stats', 4 * constants.CULL_STATS_WORDS);
      this.plan = buffer('plan.plan', sizes.plan);
      this.pageRanges = buffer('plan.page_ranges', sizes.pageRanges);
      this.limits = memory.buffer('gs.plan.limits', 16, uniform | copyDestination);
      this.splats = buffer('project.splats', layouts.ProjectedSplat.size * this.capacity);
      this.#keys = perSplat('sort.keys');
      this.#order = perSplat('sort.order');
      this.#pingPong = this.#makePingPong(pingPongBytes);
      this.digitCounts = buffer(
        'sort.digit_counts',
        4 * constants.DIGITS * Math.ceil(this.capacity / constants.SORT_BLOCK),
      );
      this.digitTotals = buffer('sort.digit_totals', 4 * constants.DIGITS);
    } catch (error) {
      memory.destroy();
      throw error;
    }
  }

  /** Depth keys. The sort alternates between the two buffers. The second belongs to {@link pingPong}. */
  get keys(): readonly [GPUBuffer, GPUBuffer] {
    return [this.#keys, this.#pingPong[0]];
  }

  /**
   * Slots in the order of their keys. The first buffer contains the result of the sort, and before the sort the indices
   * of the survivors. The second belongs to {@link pingPong}.
   */
  get order(): readonly [GPUBuffer, GPUBuffer] {
    return [this.#order, this.#pingPong[1]];
  }

  /** Two temporary buffers of the sort. The rasterizer may use them afterwards. */
  get pingPong(): readonly [GPUBuffer, GPUBuffer] {
    return this.#pingPong;
  }

  /** Resizes the buffers for other blocks. All bindings of the buffers of groups and blocks must be recreated. */
  fitPages(groups: number, pages: number): void {
    const { storage, copyDestination, copySource } = BUFFER_USAGE;
    const grown = (buffer: GPUBuffer, bytes: number): GPUBuffer => {
      if (buffer.size >= bytes) return buffer;
      this.memory.free(buffer);
      return this.memory.buffer(buffer.label, bytes, storage | copySource | copyDestination);
    };
    const sizes = groupBytes(groups, pages);
    this.chunkShares = grown(this.chunkShares, sizes.chunkShares);
    this.visibleBits = grown(this.visibleBits, sizes.visibleBits);
    this.groupOffsets = grown(this.groupOffsets, sizes.groupOffsets);
    this.plan = grown(this.plan, sizes.plan);
    this.pageRanges = grown(this.pageRanges, sizes.pageRanges);
  }

  /** Writes the range of groups of each block, and the limits of `plan`. */
  lay({ blocks, firstGroups, groups }: Pick<BlockTable, 'blocks' | 'firstGroups' | 'groups'>): void {
    const ranges = blocks.flatMap((_, page) => [firstGroups[page], firstGroups[page + 1]]);
    this.#device.queue.writeBuffer(this.pageRanges, 0, Uint32Array.from(ranges));
    this.#device.queue.writeBuffer(this.limits, 0, Uint32Array.of(blocks.length, this.capacity, groups));
  }

  /** Resizes {@link pingPong} for a rasterizer. All bindings of both buffers must be recreated. */
  fitPingPong(bytes: number): void {
    if (this.#pingPong[0].size === this.#pingPongSize(bytes)) return;
    for (const buffer of this.#pingPong) this.memory.free(buffer);
    this.#pingPong = this.#makePingPong(bytes);
  }

  /**
   * Indices of the visible splats by slot. Valid after {@link keepSurvivors} is recorded, because the sort overwrites
   * the original list.
   */
  get survivors(): GPUBuffer {
    return this.kept('survivors');
  }

  /** Records the copy to {@link survivors}: call it after `compact` and before the sort. */
  keepSurvivors(encoder: GPUCommandEncoder): void {
    encoder.copyBufferToBuffer(this.#order, 0, this.survivors, 0, 4 * this.capacity);
  }

  /** Camera depths by slot, float32. Valid after {@link keepDepths} is recorded. */
  get depths(): GPUBuffer {
    return this.kept('depths');
  }

  /**
   * Records the copy to {@link depths}: call it after `project` and before the sort, which moves the keys. The keys of
   * the frame must be depths.
   */
  keepDepths(encoder: GPUCommandEncoder): void {
    encoder.copyBufferToBuffer(this.#keys, 0, this.depths, 0, 4 * this.capacity);
  }

  /** Returns a buffer with `bytes` for each visible splat, which is created at the first request. */
  kept(name: string, bytes = 4): GPUBuffer {
    let buffer = this.#kept.get(name);
    if (buffer === undefined) {
      const { storage, copyDestination, copySource } = BUFFER_USAGE;
      buffer = this.memory.buffer(`gs.${name}`, bytes * this.capacity, storage | copySource | copyDestination);
      this.#kept.set(name, buffer);
    }
    return buffer;
  }

  #pingPongSize(bytes: number): number {
    return 4 * Math.max(1, this.capacity, Math.ceil(bytes / 4));
  }

  #makePingPong(bytes: number): readonly [GPUBuffer, GPUBuffer] {
    const { storage, copyDestination, copySource } = BUFFER_USAGE;
    const buffer = (name: string): GPUBuffer =>
      this.memory.buffer(`gs.sort.${name}`, this.#pingPongSize(bytes), storage | copySource | copyDestination);
    return [buffer('spare_keys'), buffer('spare_order')];
  }
}

/** Sizes in bytes of the buffers that depend on groups and blocks. */
const groupBytes = (groups: number, pages: number) => ({
  chunkShares: 4 * (groups + 1),
  visibleBits: 4 * constants.WORDS_PER_GROUP * groups,
  groupOffsets: scanBytes(groups),
  plan: PLAN_SIZE + PAGE_PLAN_SIZE * Math.max(1, pages),
  pageRanges: 8 * Math.max(1, pages),
});

/** Returns the maximum number of projected splats in one storage buffer of the device. */
export function maxVisible(device: GPUDevice): number {
  const { maxBufferSize, maxStorageBufferBindingSize } = device.limits;
  return Math.floor(Math.min(maxBufferSize, maxStorageBufferBindingSize) / layouts.ProjectedSplat.size);
}
