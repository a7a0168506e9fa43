/** Images of few tiles: a thread has one pixel, and long lists are divided. Loaded with the first such frame. */
import { binCut, binIndexFew, binOrderFew, rasterizeTilesFew } from '../generated/few-shaders.js';
import { constants } from '../generated/shaders.js';
import { BUFFER_USAGE, kernelOf, madeTogether, type ComputeKernel, type Resource } from '../gpu/kernel.js';
import { selfTestOf } from '../gpu/self-test-of.js';
import type { FewTilesLoader } from './few-tiles-loader.js';
import type { TilePainter } from './tile-painter.js';
import type { GpuMemory } from '../gpu/memory.js';
import {
  rasterizeKernel,
  WHOLE_LISTS,
  type FewStage,
  type RasterizeKernel,
  type RasterizeVariant,
} from './tile-kernels.js';

const { DIVISION_WORDS, END_AT, MAX_DIVIDED, MAX_SEGMENTS, MAX_TILES, PROJECT_GROUP, TILES_PER_BIN } = constants;
const { SMALL_TILE, TINY_TILE } = constants;

const LONG_PAIRS = 8_192;
const VERY_LONG_PAIRS = 98_304;

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
  /** Minimum number of pairs of the longest list from which lists are divided. Shorter ones would gain nothing. */
  readonly longPairs: number;
  readonly #device: GPUDevice;
  readonly #veryLongPairs: number;
  readonly #index: ComputeKernel<typeof binIndexFew>;
  readonly #order: ComputeKernel<typeof binOrderFew>;
  readonly #cut: ComputeKernel<typeof binCut>;

  /**
   * @param segmentSplats Minimum number of splats of a segment, for tests with short lists. Default: 512.
   * @param veryLongPairs Minimum number of pairs of the longest list for tiny tiles, for tests.
   */
  constructor(device: GPUDevice, segmentSplats?: number, veryLongPairs: number = VERY_LONG_PAIRS) {
    this.#device = device;
    this.#veryLongPairs = veryLongPairs;
    this.longPairs = segmentSplats ? 0 : LONG_PAIRS;
    this.#index = kernelOf(device, binIndexFew);
    this.#order = kernelOf(device, binOrderFew, segmentSplats ? { segment_splats: segmentSplats } : {});
    this.#cut = kernelOf(device, binCut);
  }

  /**
   * Returns the side of the tiles of a small image. Lists of tiny tiles are about a quarter as long, and they may shrink
   * by half before tiles are larger again, so that frames do not alternate.
   * @param longest Number of pairs of the longest list. @param tile Side of the tiles of the last frame.
   */
  tileFor(longest: number, tile?: number): number {
    const isVeryLong = longest >= this.#veryLongPairs / (tile === TINY_TILE ? 8 : 1);
    return isVeryLong ? TINY_TILE : SMALL_TILE;
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

  /** Compiles the pipelines of a variant. */
  prepare(variant: RasterizeVariant): void {
    for (const stage of [...STAGES, WHOLE_LISTS] as const) this.kernel(variant, stage).prepare();
  }

  /** Returns the dispatches of a frame with their numbers of workgroups. @param tiles Number of tiles. */
  dispatches(
    painter: TilePainter,
    variant: RasterizeVariant,
    isDivided: boolean,
    tiles: number,
  ): (readonly [RasterizeKernel, number])[] {
    if (!isDivided) return [[painter.few!(variant, WHOLE_LISTS)!, tiles]];
    return STAGES.map((stage) => [painter.few!(variant, stage)!, MAX_SEGMENTS + (stage === 0 ? tiles : 0)]);
  }
}

/** Dispatches of a frame with divided lists: shaders/shared/segments.wgsl. */
const STAGES = [0, 1, 2] as const;
/** Minimum number of splats of a segment in the self-test, whose lists are short. */
const TESTED_SPLATS = 16;

/**
 * Compiles and tests the kernels. They are used from the test on, and not after it if it fails.
 * @param wanted Variants whose pipelines are compiled.
 */
export async function loadFewTiles(
  device: GPUDevice,
  loader: FewTilesLoader,
  wanted: readonly RasterizeVariant[],
): Promise<void> {
  const make = async (splats?: number): Promise<void> => {
    let few: FewTiles | undefined;
    await madeTogether(device, () => {
      few = new FewTiles(device, splats);
      for (const variant of wanted) few.prepare(variant);
    });
    loader.now = few;
  };
  await make(TESTED_SPLATS);
  const { run } = selfTestOf(device);
  if (run === undefined || (await run('divided lists'))) await make();
  else loader.now = undefined;
}
