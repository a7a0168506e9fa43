/** Images of few tiles: a thread has one pixel, and long lists are divided. Loaded with the first such frame. */
import { binCut, binIndexFew, binOrderFew, rasterizeTilesFew } from '../generated/few-shaders.js';
import { constants } from '../generated/shaders.js';
import { BUFFER_USAGE, kernelOf, type ComputeKernel, type Resource } from '../gpu/kernel.js';
import type { GpuMemory } from '../gpu/memory.js';
import { rasterizeKernel, type FewStage, type RasterizeKernel, type RasterizeVariant } from './tile-kernels.js';

const { DIVISION_WORDS, END_AT, MAX_DIVIDED, MAX_SEGMENTS, MAX_TILES, PROJECT_GROUP, TILES_PER_BIN } = constants;

const LONG_PAIRS = 8_192;

/** Buffers of one rasterizer for divided lists. */
export interface FewBuffers {
  /** Results of segments, and the splats after which each tile was finished: see shaders/shared/segments.wgsl. */
  readonly segments: GPUBuffer;
  /** Number of splats of each tile. */
  readonly tileSplats: GPUBuffer;
  /** Number of splats of each tile in each 256 pairs. */
  readonly groupSplats: GPUBuffer;
}

/** Kernels of one device for images of few tiles. */
export class FewTiles {
  /** Words of `bin_order` that divided lists need. */
  readonly words = DIVISION_WORDS;
  /** Number of workgroups in front of those of the tiles. */
  readonly segments = MAX_SEGMENTS;
  /** Minimum number of pairs of the longest list from which lists are divided. Shorter ones would gain nothing. */
  readonly longPairs: number;
  readonly #device: GPUDevice;
  readonly #index: ComputeKernel<typeof binIndexFew>;
  readonly #order: ComputeKernel<typeof binOrderFew>;
  readonly #cut: ComputeKernel<typeof binCut>;

  /** @param segmentSplats Minimum number of splats of a segment, for tests with short lists. Default: 512. */
  constructor(device: GPUDevice, segmentSplats?: number) {
    this.#device = device;
    this.longPairs = segmentSplats ? 0 : LONG_PAIRS;
    this.#index = kernelOf(device, binIndexFew);
    this.#order = kernelOf(device, binOrderFew, segmentSplats ? { segment_splats: segmentSplats } : {});
    this.#cut = kernelOf(device, binCut);
  }

  buffers(memory: GpuMemory, pairCapacity: number): FewBuffers {
    const buffer = (name: string, words: number): GPUBuffer =>
      memory.buffer(`gs.bin.${name}`, 4 * words, BUFFER_USAGE.storage);
    return {
      segments: buffer('segments', END_AT + MAX_TILES),
      tileSplats: buffer('tile_splats', MAX_TILES),
      groupSplats: buffer('group_splats', TILES_PER_BIN * Math.ceil(pairCapacity / PROJECT_GROUP)),
    };
  }

  /** Returns what follows the sort of the pairs: indexes them, orders the bins and divides long lists. */
  lister(
    { segments, tileSplats, groupSplats }: FewBuffers,
    index: Readonly<Record<Exclude<keyof (typeof binIndexFew)['bindings'], 'tile_splats' | 'group_splats'>, Resource>>,
    order: Readonly<Record<'view' | 'ranges' | 'bin_order', Resource>>,
  ): (pass: GPUComputePassEncoder, groups: number) => void {
    const indexed = this.#index.bind({ ...index, tile_splats: tileSplats, group_splats: groupSplats });
    const ordered = this.#order.bind({ ...order, tile_splats: tileSplats, segments });
    const divided = this.#cut.bind({ ...order, group_splats: groupSplats });
    return (pass, groups) => {
      this.#index.dispatch(pass, indexed, groups);
      this.#order.dispatch(pass, ordered, 1);
      this.#cut.dispatch(pass, divided, MAX_DIVIDED);
    };
  }

  /** Returns the kernel that rasterizes without depth or auxiliary outputs. */
  kernel(variant: RasterizeVariant, stage: FewStage): RasterizeKernel {
    return rasterizeKernel(this.#device, rasterizeTilesFew, variant, { stage });
  }
}
