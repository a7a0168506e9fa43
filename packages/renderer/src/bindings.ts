import type { GeometryReading } from './geometry-reading.js';
import type { PageRequests } from './gaussian-scene.js';
import type { BlockTable } from './block-table.js';
import type { Scratch } from './scratch.js';
import type { DetailBudget } from './stages/detail-budget.js';
import { SortStage } from './stages/sort.js';
import { compactStage, cullChunksStage, cullStage, planStage, projectStage } from './stages/stage.js';
import type { Variants } from './variants.js';

/** The stages before the rasterizer; each is a shader of the same name. */
export interface Stages {
  readonly plan: ReturnType<typeof planStage>;
  readonly compact: ReturnType<typeof compactStage>;
  readonly sort: SortStage;
  /** Returns the stages that read a kind of geometry; default: `PackedGaussian`. */
  readonly reading: (kind?: GeometryReading) => ReadingStages;
}

interface ReadingStages {
  readonly cullChunks: ReturnType<typeof cullChunksStage>;
  readonly cull: ReturnType<typeof cullStage>;
  readonly project: ReturnType<typeof projectStage>;
}

export function makeStages(device: GPUDevice, { threads }: Pick<Variants, 'threads'>): Stages {
  const readingStages = (kind?: GeometryReading): ReadingStages => ({
    cullChunks: cullChunksStage(device, kind),
    cull: cullStage(device, threads, kind),
    project: projectStage(device, kind),
  });
  const packed = readingStages();
  return {
    plan: planStage(device, threads),
    compact: compactStage(device),
    sort: new SortStage(device, threads),
    reading: (kind) => (kind ? readingStages(kind) : packed),
  };
}

/** Bind groups of one block. */
interface BlockBindings {
  readonly splatCount: number;
  /** Page requests of a streamed scene, and their bind group; undefined for other scenes. */
  readonly requests?: { readonly of: PageRequests; readonly note: GPUBindGroup };
  readonly reading: ReadingStages;
  readonly cullChunks: GPUBindGroup;
  readonly cull: GPUBindGroup;
  readonly compact: GPUBindGroup;
  readonly project: GPUBindGroup;
}

/**
 * The stages that keep a frame within a splat budget. `count` has a bind group for each block, `threshold` reads the
 * sums of all blocks.
 */
interface BudgetBindings {
  readonly stages: DetailBudget;
  readonly count: readonly GPUBindGroup[];
  readonly threshold: GPUBindGroup;
}

/** Buffers that {@link FrameBindings} binds. */
export interface FrameBuffers {
  readonly table: BlockTable;
  readonly scratch: Scratch;
}

/** Bind groups of all stages before the rasterizer, for one block table and one capacity. */
export class FrameBindings {
  readonly blocks: readonly BlockBindings[];
  /** Undefined without levels of detail. */
  readonly budget: BudgetBindings | undefined;
  /** Bind group of `plan`, which counts the survivors of each block in the order of the file. */
  readonly plan: GPUBindGroup;
  readonly #sorts = new Map<number, ReturnType<SortStage['bind']>>();
  readonly table: BlockTable;
  readonly scratch: Scratch;
  readonly #stages: Stages;

  constructor(stages: Stages, { table, scratch }: FrameBuffers) {
    this.#stages = stages;
    this.table = table;
    this.scratch = scratch;
    this.blocks = bindBlocks(stages, table, scratch);
    this.budget = bindBudget(table, scratch);
    scratch.lay(table);
    this.plan = stages.plan.bind({
      limits: scratch.limits,
      values: scratch.groupOffsets,
      page_ranges: scratch.pageRanges,
      plan: scratch.plan,
    });
  }

  /** Returns the bind groups for a sort by keys of `keyBits` bits, 16 to 32; they are created once. */
  sort(keyBits: number): ReturnType<SortStage['bind']> {
    const known = this.#sorts.get(keyBits);
    if (known) return known;
    const { plan, keys, order, digitCounts, digitTotals } = this.scratch;
    const made = this.#stages.sort.bind({ plan, keys, values: order, digitCounts, digitTotals }, keyBits);
    this.#sorts.set(keyBits, made);
    return made;
  }
}

function bindBudget(
  table: BlockTable,
  { detailCounts: detail_counts, chunkShares }: Scratch,
): BudgetBindings | undefined {
  const stages = table.detailBudget;
  return (
    stages && {
      stages,
      count: table.blocks.map(({ chunks, details = chunks }, i) =>
        stages.count.bind({ view: table.view(i), chunks, details, detail_counts }),
      ),
      threshold: stages.threshold.bind({ view: table.view(0), detail_counts, chunk_shares: chunkShares }),
    }
  );
}

function bindBlocks(stages: Stages, table: BlockTable, scratch: Scratch): BlockBindings[] {
  const { chunkShares, visibleBits, groupOffsets, cullStats, plan, splats, keys, order } = scratch;
  // The sort writes its first order buffer only after `project` has read the survivors from that buffer.
  const survivors = order[0];
  return table.blocks.map((page, i) => {
    const view = table.view(i);
    const gaussians = page.geometry;
    const reading = stages.reading(table.readingOf(i));
    const modifiers = table.modifiersOf(i);
    const requests = table.requestsOf(i);
    // A binding cannot be empty. Without levels of detail the shader does not read this one.
    const details = page.details ?? page.chunks;
    const chunk = { view, visible_bits: visibleBits };
    return {
      reading,
      splatCount: page.count,
      requests: requests && {
        of: requests,
        note: requests.bind({ view, chunks: page.chunks, details, chunk_shares: chunkShares }),
      },
      cullChunks: reading.cullChunks.bind({
        ...{ ...chunk, ...modifiers },
        chunks: page.chunks,
        group_counts: groupOffsets,
        chunk_shares: chunkShares,
        details,
      }),
      cull: reading.cull.bind({
        ...{ ...chunk, ...modifiers },
        gaussians,
        group_counts: groupOffsets,
        cull_stats: cullStats,
        chunk_shares: chunkShares,
      }),
      compact: stages.compact.bind({ ...chunk, group_offsets: groupOffsets, survivors }),
      project: reading.project.bind({
        ...{ ...modifiers, view, gaussians, sh: page.sh, survivors, plan, cull_stats: cullStats, splats },
        keys: keys[0],
        chunk_shares: chunkShares,
      }),
    };
  });
}
