import { constants, layouts, type binIndex, type binOrder } from '../generated/shaders.js';
import { BUFFER_USAGE, type Resources } from '../gpu/kernel.js';
import { BufferOwner, GpuMemory } from '../gpu/memory.js';
import { writeStruct } from '../gpu/struct.js';
import { sortedIn, SortStage, type SortBindings } from '../stages/sort.js';
import type { CountPlace } from '../copy-counts.js';
import type { Threads } from '../stages/stage.js';
import { TRAINED_TRANSMITTANCE } from '../render-settings.js';
import type {
  AccumulationFormat,
  Painting,
  RasterSettings,
  Rasterizer,
  RasterizerInputs,
  Slice,
} from './rasterizer.js';
import { pairBuffers, releasableBytesOf, type PairBuffers } from './pair-buffers.js';
import { listingKernels, type ListingKernels, type PaintedTiles, type RasterizeVariant } from './tile-kernels.js';
import { FEW_BINS, gridFor, type Grid } from './grid.js';
import { fewTilesOn, type FewTilesLoader } from './few-tiles-loader.js';
import type { FewBuffers, FewTiles } from './few-tiles.js';
import { PlainPainter, type TilePainter } from './tile-painter.js';

const { PREFIX_THREADS, PROJECT_GROUP, TILES_PER_BIN } = constants;

const groupsOf = (splats: number): number => Math.ceil(splats / PREFIX_THREADS);

/** Bindings for one scratch and one grid of bins. */
interface GridBindings {
  readonly grid: Grid;
  readonly ranges: GPUBuffer;
  /** Indices of the bins in the order of rasterization, longest lists first, and the number of long bins. */
  readonly binOrder: GPUBuffer;
  readonly count: GPUBindGroup;
  readonly emit: GPUBindGroup;
  readonly plan: GPUBindGroup;
  readonly sort: SortBindings;
  /** Records what follows the sort of the pairs. */
  readonly list: (pass: GPUComputePassEncoder, groups: number) => void;
}

/** Image formats that a compute shader can write without an optional feature. */
const STORABLE: readonly GPUTextureFormat[] = ['rgba8unorm', 'rgba16float', 'rgba32float'];
/** Image format that a compute shader can write with the feature `bgra8unorm-storage`. */
const STORABLE_WITH_FEATURE: GPUTextureFormat = 'bgra8unorm';

/** Maximum number of grids with cached bindings. */
const MAX_GRIDS = 12;

/**
 * Whether a pixel ends before the splat that would reach the minimum transmittance, as in training. With a minimum
 * above that of training, the pixel ends after this splat.
 */
const refusesLast = ({ transmittanceMin }: RasterSettings): boolean => transmittanceMin <= TRAINED_TRANSMITTANCE;

const TRANSPARENT = [0, 0, 0, 0] as const;

/**
 * Rasterizes splats with compute shaders on two scales of tiles. Splats are listed, in depth order, for bins of 8 x 4
 * tiles: pairs of splat and bin are counted, written, and sorted by bin with a stable sort. A workgroup then blends the
 * splats of a tile front to back, or of four tiles in a short list, and stops when all its pixels are opaque. Bins with
 * the longest lists come first.
 *
 * Pairs beyond the capacity are dropped. They belong to the farthest splats.
 */
export class TilesRasterizer extends BufferOwner implements Rasterizer {
  readonly name = 'tiles';
  readonly pingPongBytes = releasableBytesOf;
  readonly #device: GPUDevice;
  readonly #accumulation: AccumulationFormat;
  readonly #plain: TilePainter;
  readonly #kernels: ListingKernels;
  readonly #sort: SortStage;
  readonly #view: GPUBuffer;
  readonly #viewBytes = new ArrayBuffer(layouts.BinView.size);
  /** Kernels for images of few tiles; undefined if threads are serial, because a few tiles keep a CPU busy. */
  readonly #fewLoader: FewTilesLoader | undefined;
  #few: FewTiles | undefined;
  #fewBuffers: FewBuffers | undefined;
  /** Number of pairs of the longest list in an earlier frame. */
  #longest = 0;
  #hasLongLists = false;
  /** Bindings of the last frame. */
  #last: GridBindings | undefined;
  #inputs: RasterizerInputs | undefined;
  #buffers: PairBuffers | undefined;
  /** Bindings by grid, because images in motion may have fewer pixels. */
  readonly #bound = new Map<string, GridBindings>();

  constructor(device: GPUDevice, accumulation: AccumulationFormat, threads: Threads) {
    super(new GpuMemory(device));
    this.#device = device;
    this.#accumulation = accumulation;
    this.#plain = new PlainPainter(device);
    this.#kernels = listingKernels(device);
    this.#fewLoader = threads === 'parallel' ? fewTilesOn(device) : undefined;
    this.#sort = new SortStage(device, threads, 'given');
    const usage = BUFFER_USAGE.uniform | BUFFER_USAGE.copyDestination;
    this.#view = this.memory.buffer('gs.rasterize.view', layouts.BinView.size, usage);
  }

  get longest(): CountPlace | undefined {
    return this.#last && { buffer: this.#last.binOrder, offset: 4 * (this.#last.grid.count + 1) };
  }

  learn(longest: number): void {
    this.#longest = longest;
  }

  get pairPlan(): GPUBuffer | undefined {
    return this.#buffers?.plan;
  }

  finishes(format: GPUTextureFormat): boolean {
    const needsFeature = format === STORABLE_WITH_FEATURE;
    return STORABLE.includes(format) || (needsFeature && this.#device.features.has('bgra8unorm-storage'));
  }

  bind(inputs: RasterizerInputs): void {
    this.#release();
    this.#inputs = inputs;
    this.#buffers = pairBuffers(this.memory, inputs);
  }

  prepare(settings: RasterSettings, format: GPUTextureFormat, painter: TilePainter = this.#plain): void {
    const prepare = (own: Pick<RasterizeVariant, 'format' | 'isFinal'>): void => {
      const variant = { ...own, refusesLast: refusesLast(settings) };
      painter.kernel(variant).prepare();
      if (painter === this.#plain) this.#fewLoader?.prepare(variant);
    };
    if (this.finishes(format)) prepare({ format, isFinal: true });
    prepare({ format: this.#accumulation, isFinal: false });
  }

  /** Records the lists of splats for all bins. */
  prepareFrame(encoder: GPUCommandEncoder, painting: Painting): void {
    if (this.#inputs === undefined || this.#buffers === undefined) return;
    if (this.#few !== this.#fewLoader?.now) this.#forgetGrids();
    this.#few = this.#fewLoader?.now;
    // Lists may shrink by a quarter before they are whole again, so that frames do not alternate.
    const longPairs = (this.#few?.longPairs ?? 0) * (this.#hasLongLists ? 0.75 : 1);
    this.#hasLongLists = this.#longest >= longPairs;
    const bound = (this.#last = this.#boundFor(painting, this.#inputs, this.#buffers));
    this.#writeView(painting, bound.grid, { index: 0, count: 1 });

    const { count, plan, emit } = this.#kernels;
    const timestampWrites = painting.timer?.timestampWrites('bin');
    const bin = encoder.beginComputePass({ label: 'gs.bin', timestampWrites });
    // Dispatches groups for the whole capacity; those beyond the actual splats and pairs end at once.
    const groups = groupsOf(this.#inputs.capacity);
    count.dispatch(bin, bound.count, groups);
    plan.dispatch(bin, bound.plan, 1);
    emit.dispatch(bin, bound.emit, groups);
    this.#sort.record(bin, bound.sort, this.#inputs.pairCapacity);
    bound.list(bin, Math.ceil(this.#inputs.pairCapacity / PROJECT_GROUP));
    bin.end();
  }

  record(encoder: GPUCommandEncoder, painting: Painting, slice: Slice): void {
    const { surface, settings, background, painter = this.#plain, timer } = painting;
    if (this.#inputs === undefined || this.#buffers === undefined) return;
    const bound = this.#boundFor(painting, this.#inputs, this.#buffers);
    // Each slice contains every `count`-th workgroup, so that all slices have long and short lists.
    const tiles = Math.ceil((bound.grid.count * TILES_PER_BIN - slice.index) / slice.count);
    if (tiles <= 0) return;
    // An undivided frame uses the view with which its splats were listed.
    if (slice.count > 1) this.#writeView(painting, bound.grid, slice);
    const paint = encoder.beginComputePass({
      label: 'gs.rasterize',
      timestampWrites: timer?.timestampWrites('rasterize'),
    });
    const own = { format: surface.format, isFinal: background !== undefined };
    const variant = { ...own, refusesLast: refusesLast(settings) };
    const isDivided = bound.grid.isDivided && slice.count === 1;
    const dispatches = bound.grid.isFew
      ? this.#few!.dispatches(painter, variant, isDivided, tiles)
      : [[painter.kernel(variant), tiles] as const];
    // All kernels of a frame have the same bindings.
    const group = painter.bind(dispatches[0][0], this.#painted(bound, surface.view));
    for (const [kernel, groups] of dispatches) kernel.dispatch(paint, group, groups);
    paint.end();
  }

  #release(): void {
    // `free` ignores the ping-pong buffers, because they belong to another `GpuMemory`.
    for (const buffer of Object.values({ ...this.#buffers, ...this.#fewBuffers }).flat())
      this.memory.free(buffer as GPUBuffer);
    this.#forgetGrids();
    this.#fewBuffers = undefined;
    this.#buffers = undefined;
  }

  #boundFor(
    { surface, painter = this.#plain }: Painting,
    inputs: RasterizerInputs,
    buffers: PairBuffers,
  ): GridBindings {
    const tile = painter === this.#plain ? this.#few?.tileFor(this.#longest, this.#last?.grid.tile) : undefined;
    const grid = gridFor(surface, painter, this.#few, this.#hasLongLists, tile);
    if (grid.count <= FEW_BINS) this.#fewLoader?.load();
    const key = JSON.stringify(grid);
    const known = this.#bound.get(key);
    if (known) return known;
    if (this.#bound.size >= MAX_GRIDS) this.#forgetGrids();
    const words = grid.count + 2 + (grid.isDivided ? this.#few!.words : 0);
    if (grid.isFew) this.#fewBuffers ??= this.#few!.buffers(this.memory, inputs.pairCapacity);
    const own = {
      ranges: this.memory.buffer('gs.bin.ranges', 8 * grid.count, BUFFER_USAGE.storage | BUFFER_USAGE.copyDestination),
      binOrder: this.memory.buffer('gs.bin.order', 4 * words, BUFFER_USAGE.storage | BUFFER_USAGE.copySource),
    };
    const bound = { grid, ...own, ...this.#bindings(inputs, buffers, grid, own) };
    this.#bound.set(key, bound);
    return bound;
  }

  #forgetGrids(): void {
    for (const { ranges, binOrder } of this.#bound.values()) {
      this.memory.free(ranges);
      this.memory.free(binOrder);
    }
    this.#bound.clear();
    this.#last = undefined;
  }

  #bindings(
    { plan, splats, order }: RasterizerInputs,
    { rects, groupPairs, plan: pairPlan, bins, pairs, digitCounts, digitTotals }: PairBuffers,
    { bits, isDivided }: Grid,
    { ranges, binOrder }: Pick<GridBindings, 'ranges' | 'binOrder'>,
  ): Omit<GridBindings, 'grid' | 'ranges' | 'binOrder'> {
    const view = this.#view;
    const sorted = sortedIn(bits);
    const { count, plan: planKernel, emit } = this.#kernels;
    const indexed = {
      ...{ view, splats, pair_plan: pairPlan, ranges },
      bins: bins[sorted],
      pairs: pairs[sorted],
      tile_bits: bins[1 - sorted]!,
    };
    const shared = { view, plan, order, rects, group_pairs: groupPairs };
    return {
      count: count.bind({ ...shared, splats }),
      emit: emit.bind({ ...shared, bins: bins[0], pairs: pairs[0] }),
      plan: planKernel.bind({ values: groupPairs, view, pair_plan: pairPlan, ranges }),
      sort: this.#sort.bind({ plan: pairPlan, keys: bins, values: pairs, digitCounts, digitTotals }, bits),
      list: this.#lister(isDivided, indexed, { view, ranges, bin_order: binOrder }),
    };
  }

  #lister(
    isDivided: boolean,
    indexed: Resources<typeof binIndex>,
    ordered: Resources<typeof binOrder>,
  ): GridBindings['list'] {
    if (isDivided) return this.#few!.lister(this.#fewBuffers!, indexed, ordered);
    const { index, order } = this.#kernels;
    const [indexGroup, orderGroup] = [index.bind(indexed), order.bind(ordered)];
    return (pass, groups) => {
      index.dispatch(pass, indexGroup, groups);
      order.dispatch(pass, orderGroup, 1);
    };
  }

  #painted(bound: GridBindings, image: GPUTextureView): PaintedTiles {
    const { splats } = this.#inputs!;
    const { pairs, bins } = this.#buffers!;
    const sorted = sortedIn(bound.grid.bits);
    return {
      view: this.#view,
      splats,
      pairs: pairs[sorted],
      ...{ ranges: bound.ranges, bin_order: bound.binOrder },
      // The unsorted input is not needed after the sort.
      tile_bits: bins[1 - sorted]!,
      segments: this.#fewBuffers?.segments,
      image,
    };
  }

  #writeView(
    { surface: { width, height }, settings, background = TRANSPARENT }: Painting,
    { tile, columns, rows }: Grid,
    { index, count }: Slice,
  ): void {
    const { capacity, pairCapacity } = this.#inputs!;
    const room = { pair_capacity: pairCapacity, splat_groups: groupsOf(capacity) };
    const image = { viewport: [width, height], bins: [columns, rows], background, part: index, parts: count };
    const own = { transmittance_min: settings.transmittanceMin, tile_side: tile };
    writeStruct(layouts.BinView, { ...room, ...image, ...own }, this.#viewBytes);
    this.#device.queue.writeBuffer(this.#view, 0, this.#viewBytes);
  }
}
