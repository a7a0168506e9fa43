import { constants, layouts } from './generated/shaders.js';
import { BUFFER_USAGE } from './gpu/kernel.js';
import { GpuMemory } from './gpu/memory.js';
import type { PageTable } from './page-table.js';
import { scanBytes } from './stages/stage.js';

/** How much the buffers between the stages must hold. */
export interface ScratchSize {
  /** Splats that may be visible at once. */
  readonly visible: number;
  /** Cull groups of all pages. */
  readonly groups: number;
  readonly pages: number;
}

const { size: PLAN_SIZE } = layouts.Plan;
const { size: PAGE_PLAN_SIZE } = layouts.PagePlan;

/** The buffers that carry a frame from stage to stage. Their size follows the scene, never the camera. */
export class Scratch {
  /** Splats that may be visible at once. Survivors beyond it are not drawn, and counted in `Plan.overflow`. */
  readonly capacity: number;
  /** Share in which each chunk is drawn, and behind them, in the last word, the pixels of error that a budget asks for. */
  chunkShares: GPUBuffer;
  /** See shaders/shared/detail_counts.wgsl. */
  readonly detailCounts: GPUBuffer;
  /** One bit for each splat. */
  visibleBits: GPUBuffer;
  /** Survivors of each cull group, then their exclusive prefix sums and the total. */
  groupOffsets: GPUBuffer;
  /** See shaders/shared/gathered.wgsl. */
  readonly gathered: GPUBuffer;
  plan: GPUBuffer;
  /** First group of each page and of the next one, [page][2]. */
  pageRanges: GPUBuffer;
  /** PlanLimits of plan.wgsl. */
  readonly limits: GPUBuffer;
  /** array<ProjectedSplat> by slot. */
  readonly splats: GPUBuffer;
  /** Depth keys. */
  readonly #keys: GPUBuffer;
  /** Slots in the order of their keys. Before the sort it lists the survivors. */
  readonly #order: GPUBuffer;
  #spare: readonly [GPUBuffer, GPUBuffer];
  /** [block][digit] */
  readonly digitCounts: GPUBuffer;
  readonly digitTotals: GPUBuffer;
  readonly #device: GPUDevice;
  readonly #memory: GpuMemory;
  readonly #kept = new Map<string, GPUBuffer>();

  /** @param spareBytes least size of {@link spare} */
  constructor(device: GPUDevice, { visible, groups, pages }: ScratchSize, spareBytes: number) {
    const memory = new GpuMemory(device);
    this.#device = device;
    this.#memory = memory;
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
      this.gathered = buffer('cull.gathered', 4 * constants.GATHERED_WORDS);
      this.plan = buffer('plan.plan', sizes.plan);
      this.pageRanges = buffer('plan.page_ranges', sizes.pageRanges);
      this.limits = memory.buffer('gs.plan.limits', 16, uniform | copyDestination);
      this.splats = buffer('project.splats', layouts.ProjectedSplat.size * this.capacity);
      this.#keys = perSplat('sort.keys');
      this.#order = perSplat('sort.order');
      this.#spare = this.#makeSpare(spareBytes);
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

  /** Depth keys; the sort goes back and forth between the two. The second is one of {@link spare}. */
  get keys(): readonly [GPUBuffer, GPUBuffer] {
    return [this.#keys, this.#spare[0]];
  }

  /** Slots in the order of their keys, which end in the first. Before the sort that lists the survivors. The second is the other of {@link spare}. */
  get order(): readonly [GPUBuffer, GPUBuffer] {
    return [this.#order, this.#spare[1]];
  }

  /** Free once splats are in order: the rasterizer's then. */
  get spare(): readonly [GPUBuffer, GPUBuffer] {
    return this.#spare;
  }

  /** Makes room for other pages; whatever was bound to the buffers for groups and pages must be bound again. */
  fitPages(groups: number, pages: number): void {
    const { storage, copyDestination, copySource } = BUFFER_USAGE;
    const grown = (buffer: GPUBuffer, bytes: number): GPUBuffer => {
      if (buffer.size >= bytes) return buffer;
      this.#memory.free(buffer);
      return this.#memory.buffer(buffer.label, bytes, storage | copySource | copyDestination);
    };
    const sizes = groupBytes(groups, pages);
    this.chunkShares = grown(this.chunkShares, sizes.chunkShares);
    this.visibleBits = grown(this.visibleBits, sizes.visibleBits);
    this.groupOffsets = grown(this.groupOffsets, sizes.groupOffsets);
    this.plan = grown(this.plan, sizes.plan);
    this.pageRanges = grown(this.pageRanges, sizes.pageRanges);
  }

  /** Tells the stages which groups belong to which page. */
  lay({ pages, firstGroups, groups }: Pick<PageTable, 'pages' | 'firstGroups' | 'groups'>): void {
    const ranges = pages.flatMap((_, page) => [firstGroups[page], firstGroups[page + 1]]);
    this.#device.queue.writeBuffer(this.pageRanges, 0, Uint32Array.from(ranges));
    this.#device.queue.writeBuffer(this.limits, 0, Uint32Array.of(pages.length, this.capacity, groups));
  }

  /** Makes {@link spare} as large as a rasterizer needs it; whatever was bound to it must be bound again. */
  fitSpare(bytes: number): void {
    if (this.#spare[0].size === this.#spareSize(bytes)) return;
    for (const buffer of this.#spare) this.#memory.free(buffer);
    this.#spare = this.#makeSpare(bytes);
  }

  /** Numbers of the visible splats by slot, once {@link keepSurvivors} has been recorded: the sort overwrites what lists them. */
  get survivors(): GPUBuffer {
    return this.kept('survivors');
  }

  /** To be recorded between `compact` and the sort. */
  keepSurvivors(encoder: GPUCommandEncoder): void {
    encoder.copyBufferToBuffer(this.#order, 0, this.survivors, 0, 4 * this.capacity);
  }

  /** Camera depths by slot, float32, once {@link keepDepths} has been recorded. */
  get depths(): GPUBuffer {
    return this.kept('depths');
  }

  /** To be recorded between `project` and the sort, which moves the keys, of a frame whose keys are depths. */
  keepDepths(encoder: GPUCommandEncoder): void {
    encoder.copyBufferToBuffer(this.#keys, 0, this.depths, 0, 4 * this.capacity);
  }

  /** A buffer with `bytes` for each visible splat, made when it is first asked for. */
  kept(name: string, bytes = 4): GPUBuffer {
    let buffer = this.#kept.get(name);
    if (buffer === undefined) {
      const { storage, copyDestination } = BUFFER_USAGE;
      buffer = this.#memory.buffer(`gs.${name}`, bytes * this.capacity, storage | copyDestination);
      this.#kept.set(name, buffer);
    }
    return buffer;
  }

  get byteLength(): number {
    return this.#memory.byteLength;
  }

  destroy(): void {
    this.#memory.destroy();
  }

  #spareSize(bytes: number): number {
    return 4 * Math.max(1, this.capacity, Math.ceil(bytes / 4));
  }

  #makeSpare(bytes: number): readonly [GPUBuffer, GPUBuffer] {
    const { storage, copyDestination, copySource } = BUFFER_USAGE;
    const buffer = (name: string): GPUBuffer =>
      this.#memory.buffer(`gs.sort.${name}`, this.#spareSize(bytes), storage | copySource | copyDestination);
    return [buffer('spare_keys'), buffer('spare_order')];
  }
}

/** Bytes of the buffers whose size follows groups and pages. */
const groupBytes = (groups: number, pages: number) => ({
  chunkShares: 4 * (groups + 1),
  visibleBits: 4 * constants.WORDS_PER_GROUP * groups,
  groupOffsets: scanBytes(groups),
  plan: PLAN_SIZE + PAGE_PLAN_SIZE * Math.max(1, pages),
  pageRanges: 8 * Math.max(1, pages),
});

/** Most projected splats that one storage buffer of the device can hold. */
export function maxVisible(device: GPUDevice): number {
  const { maxBufferSize, maxStorageBufferBindingSize } = device.limits;
  return Math.floor(Math.min(maxBufferSize, maxStorageBufferBindingSize) / layouts.ProjectedSplat.size);
}
