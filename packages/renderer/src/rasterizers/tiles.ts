import { constants, layouts } from '../generated/shaders.js';
import { BUFFER_USAGE } from '../gpu/kernel.js';
import { BufferOwner, GpuMemory } from '../gpu/memory.js';
import { writeStruct } from '../gpu/struct.js';
import { sortedIn, SortStage, type SortBindings } from '../stages/sort.js';
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
import { PlainPainter, type TilePainter } from './tile-painter.js';

const { BIN_COLUMNS, BIN_ROWS, PREFIX_THREADS, PROJECT_GROUP, TILES_PER_BIN } = constants;

const groupsOf = (splats: number): number => Math.ceil(splats / PREFIX_THREADS);

/** Number of columns and rows of bins in an image, and number of bits of the index of a bin. */
interface Grid {
  readonly columns: number;
  readonly rows: number;
  readonly bits: number;
}

/** Bindings for one scratch, one number of bins and one tile size. */
interface GridBindings {
  readonly grid: Grid;
  readonly kernels: ListingKernels;
  readonly ranges: GPUBuffer;
  /** Indices of the bins in the order of rasterization: longest lists first. */
  readonly binOrder: GPUBuffer;
  readonly count: GPUBindGroup;
  readonly emit: GPUBindGroup;
  readonly plan: GPUBindGroup;
  readonly sort: SortBindings;
  readonly index: GPUBindGroup;
  readonly order: GPUBindGroup;
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
 * tiles: pairs of splat and bin are counted, written, and sorted by bin with a stable sort. Each tile then blends the
 * splats of its bin front to back, and stops when all its pixels are opaque. Bins with the longest lists come first.
 *
 * Pairs beyond the capacity are dropped. They belong to the farthest splats.
 */
export class TilesRasterizer extends BufferOwner implements Rasterizer {
  readonly name = 'tiles';
  readonly pingPongBytes = releasableBytesOf;
  readonly #device: GPUDevice;
  readonly #accumulation: AccumulationFormat;
  readonly #plain: TilePainter;
  readonly #sort: SortStage;
  readonly #view: GPUBuffer;
  readonly #viewBytes = new ArrayBuffer(layouts.BinView.size);
  #inputs: RasterizerInputs | undefined;
  #buffers: PairBuffers | undefined;
  /** Bindings by tile size and number of columns and rows of bins, because images in motion may have fewer pixels. */
  readonly #bound = new Map<string, GridBindings>();

  constructor(device: GPUDevice, accumulation: AccumulationFormat, threads: Threads) {
    super(new GpuMemory(device));
    this.#device = device;
    this.#accumulation = accumulation;
    this.#plain = new PlainPainter(device);
    listingKernels(device, this.#plain.tile);
    this.#sort = new SortStage(device, threads, 'given');
    const usage = BUFFER_USAGE.uniform | BUFFER_USAGE.copyDestination;
    this.#view = this.memory.buffer('gs.rasterize.view', layouts.BinView.size, usage);
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
    listingKernels(this.#device, painter.tile);
    const prepare = (own: Pick<RasterizeVariant, 'format' | 'isFinal'>): unknown =>
      painter.kernel({ ...own, refusesLast: refusesLast(settings) }).prepare();
    if (this.finishes(format)) prepare({ format, isFinal: true });
    prepare({ format: this.#accumulation, isFinal: false });
  }

  /** Records the lists of splats for all bins. */
  prepareFrame(encoder: GPUCommandEncoder, painting: Painting): void {
    if (this.#inputs === undefined || this.#buffers === undefined) return;
    const bound = this.#gridFor(painting, this.#inputs, this.#buffers);
    this.#writeView(painting, bound.grid, { index: 0, count: 1 });

    const { count, plan, emit, index, order } = bound.kernels;
    const timestampWrites = painting.timer?.timestampWrites('bin');
    const bin = encoder.beginComputePass({ label: 'gs.bin', timestampWrites });
    // Dispatches groups for the whole capacity; those beyond the actual splats and pairs end at once.
    const groups = groupsOf(this.#inputs.capacity);
    count.dispatch(bin, bound.count, groups);
    plan.dispatch(bin, bound.plan, 1);
    emit.dispatch(bin, bound.emit, groups);
    this.#sort.record(bin, bound.sort, this.#inputs.pairCapacity);
    index.dispatch(bin, bound.index, Math.ceil(this.#inputs.pairCapacity / PROJECT_GROUP));
    order.dispatch(bin, bound.order, 1);
    bin.end();
  }

  record(encoder: GPUCommandEncoder, painting: Painting, slice: Slice): void {
    const { surface, settings, background, painter = this.#plain, timer } = painting;
    if (this.#inputs === undefined || this.#buffers === undefined) return;
    const bound = this.#gridFor(painting, this.#inputs, this.#buffers);
    // Each slice contains every `count`-th tile, so that all slices have long and short lists.
    const tiles = bound.grid.columns * bound.grid.rows * TILES_PER_BIN;
    const groups = Math.ceil((tiles - slice.index) / slice.count);
    if (groups <= 0) return;
    // An undivided frame uses the view with which its splats were listed.
    if (slice.count > 1) this.#writeView(painting, bound.grid, slice);
    const paint = encoder.beginComputePass({
      label: 'gs.rasterize',
      timestampWrites: timer?.timestampWrites('rasterize'),
    });
    const kernel = painter.kernel({
      ...{ format: surface.format, isFinal: background !== undefined },
      refusesLast: refusesLast(settings),
    });
    kernel.dispatch(paint, painter.bind(kernel, this.#painted(bound, surface.view)), groups);
    paint.end();
  }

  #release(): void {
    // `free` ignores the ping-pong buffers, because they belong to another `GpuMemory`.
    for (const buffer of Object.values(this.#buffers ?? {}).flat()) this.memory.free(buffer as GPUBuffer);
    this.#forgetGrids();
    this.#buffers = undefined;
  }

  #gridFor(
    { surface: { width, height }, painter = this.#plain }: Painting,
    inputs: RasterizerInputs,
    buffers: PairBuffers,
  ): GridBindings {
    const columns = Math.ceil(width / (BIN_COLUMNS * painter.tile));
    const rows = Math.ceil(height / (BIN_ROWS * painter.tile));
    const key = `${painter.tile} ${columns} ${rows}`;
    const known = this.#bound.get(key);
    if (known) return known;
    if (this.#bound.size >= MAX_GRIDS) this.#forgetGrids();
    const bins = columns * rows;
    const grid = { columns, rows, bits: Math.ceil(Math.log2(bins)) };
    const own = {
      kernels: listingKernels(this.#device, painter.tile),
      ranges: this.memory.buffer('gs.bin.ranges', 8 * bins, BUFFER_USAGE.storage | BUFFER_USAGE.copyDestination),
      binOrder: this.memory.buffer('gs.bin.order', 4 * bins, BUFFER_USAGE.storage),
    };
    const bound = { grid, ...own, ...this.#bindings(inputs, buffers, grid.bits, own) };
    this.#bound.set(key, bound);
    return bound;
  }

  #forgetGrids(): void {
    for (const { ranges, binOrder } of this.#bound.values()) {
      this.memory.free(ranges);
      this.memory.free(binOrder);
    }
    this.#bound.clear();
  }

  #bindings(
    { plan, splats, order }: RasterizerInputs,
    { rects, groupPairs, plan: pairPlan, bins, pairs, digitCounts, digitTotals }: PairBuffers,
    bits: number,
    { kernels, ranges, binOrder }: Pick<GridBindings, 'kernels' | 'ranges' | 'binOrder'>,
  ): Omit<GridBindings, 'grid' | 'kernels' | 'ranges' | 'binOrder'> {
    const view = this.#view;
    const sorted = sortedIn(bits);
    const { count, plan: planKernel, emit, index, order: orderKernel } = kernels;
    const shared = { view, plan, order, rects, group_pairs: groupPairs };
    return {
      count: count.bind({ ...shared, splats }),
      emit: emit.bind({ ...shared, bins: bins[0], pairs: pairs[0] }),
      plan: planKernel.bind({ values: groupPairs, view, pair_plan: pairPlan, ranges }),
      sort: this.#sort.bind({ plan: pairPlan, keys: bins, values: pairs, digitCounts, digitTotals }, bits),
      index: index.bind({
        ...{ view, splats, pair_plan: pairPlan },
        bins: bins[sorted],
        pairs: pairs[sorted],
        ranges,
        tile_bits: bins[1 - sorted]!,
      }),
      order: orderKernel.bind({ view, ranges, bin_order: binOrder }),
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
      image,
    };
  }

  #writeView(
    { surface: { width, height }, settings, background = TRANSPARENT }: Painting,
    { columns, rows }: Grid,
    { index, count }: Slice,
  ): void {
    const { capacity, pairCapacity } = this.#inputs!;
    const room = { pair_capacity: pairCapacity, splat_groups: groupsOf(capacity) };
    const image = { viewport: [width, height], bins: [columns, rows], background, part: index, parts: count };
    writeStruct(layouts.BinView, { ...room, ...image, transmittance_min: settings.transmittanceMin }, this.#viewBytes);
    this.#device.queue.writeBuffer(this.#view, 0, this.#viewBytes);
  }
}
