import { constants, layouts, type rasterizeTilesNoting } from '../generated/shaders.js';
import { BUFFER_USAGE, TEXTURE_USAGE, type ComputeKernel } from '../gpu/kernel.js';
import { GpuMemory } from '../gpu/memory.js';
import { writeStruct } from '../gpu/struct.js';
import { sortedIn, SortStage, type SortBindings } from '../stages/sort.js';
import type { Threads } from '../stages/plan.js';
import { TRAINED_TRANSMITTANCE } from '../render-settings.js';
import type {
  AccumulationFormat,
  AuxiliaryOutputs,
  AuxiliaryFrame,
  OrderedPainting,
  Painting,
  PaintingLevers,
  Rasterizer,
  RasterizerInputs,
  Room,
  Slice,
  Surface,
} from './rasterizer.js';
import { pairBuffers, spareBytesOf, type PairBuffers } from './pair-buffers.js';
import {
  listingKernels,
  rasterizeKernel,
  type ListingKernels,
  type RasterizeKernel,
  type RasterizeVariant,
} from './tile-kernels.js';
import { sliceOfTiles } from './tile-slice.js';

const { BIN_WIDTH, BIN_HEIGHT, PREFIX_THREADS, PROJECT_GROUP, TILE } = constants;

const groupsOf = (splats: number): number => Math.ceil(splats / PREFIX_THREADS);

/** Bins across and down of an image, and the bits of a bin's number. */
interface Grid {
  readonly columns: number;
  readonly rows: number;
  readonly bits: number;
}

/** What is bound for one scene and one number of bins. */
interface GridBindings {
  readonly grid: Grid;
  readonly ranges: GPUBuffer;
  readonly count: GPUBindGroup;
  readonly emit: GPUBindGroup;
  readonly plan: GPUBindGroup;
  readonly sort: SortBindings;
  readonly index: GPUBindGroup;
  /** By the view of the image. */
  readonly rasterize: WeakMap<GPUTextureView, GPUBindGroup>;
}

/** Formats of images that a compute shader may write without an optional feature, and the one that asks for one. */
const STORABLE: readonly GPUTextureFormat[] = ['rgba8unorm', 'rgba16float', 'rgba32float'];
const STORABLE_WITH_FEATURE: GPUTextureFormat = 'bgra8unorm';

/** Numbers of bins that are kept bound. */
const MAX_GRIDS = 12;

/** At the threshold that scenes are trained with, the splat that would go below it is refused; at higher ones it is the last that is blended. */
const refusesLast = ({ transmittanceMin }: PaintingLevers): boolean => transmittanceMin <= TRAINED_TRANSMITTANCE;

const TRANSPARENT = [0, 0, 0, 0] as const;

/**
 * Compute shaders on two scales of tiles. Splats are listed, in depth order, for bins of 128 x 64 pixels: counted,
 * written, and sorted by bin with a stable sort that keeps the depth order. Tiles of 16 x 16 pixels then walk their bin's
 * list front to back and stop when all their pixels are opaque.
 *
 * Pairs beyond the room for them belong to the farthest splats; they are left out.
 */
export class TilesRasterizer implements Rasterizer {
  readonly name = 'tiles';
  readonly #device: GPUDevice;
  readonly #accumulation: AccumulationFormat;
  readonly #memory: GpuMemory;
  /** Their bind groups fit those of other settings. */
  readonly #kernels: ListingKernels;
  readonly #sort: SortStage;
  readonly #view: GPUBuffer;
  readonly #viewBytes = new ArrayBuffer(layouts.BinView.size);
  #inputs: RasterizerInputs | undefined;
  #buffers: PairBuffers | undefined;
  /** By the number of bins across and down: pictures in motion may have fewer pixels. */
  readonly #bound = new Map<string, GridBindings>();
  /** Where auxiliary outputs go that no caller asked for. */
  #nowhere: Required<AuxiliaryOutputs> | undefined;
  #noted: AuxiliaryFrame | undefined;

  constructor(device: GPUDevice, accumulation: AccumulationFormat, threads: Threads) {
    this.#device = device;
    this.#accumulation = accumulation;
    this.#memory = new GpuMemory(device);
    this.#kernels = listingKernels(device);
    this.#sort = new SortStage(device, threads, 'given');
    const usage = BUFFER_USAGE.uniform | BUFFER_USAGE.copyDestination;
    this.#view = this.#memory.buffer('gs.rasterize.view', layouts.BinView.size, usage);
  }

  get byteLength(): number {
    return this.#memory.byteLength;
  }

  get pairPlan(): GPUBuffer | undefined {
    return this.#buffers?.plan;
  }

  get auxiliary(): AuxiliaryFrame | undefined {
    return this.#noted;
  }

  finishes(format: GPUTextureFormat): boolean {
    const needsFeature = format === STORABLE_WITH_FEATURE;
    return STORABLE.includes(format) || (needsFeature && this.#device.features.has('bgra8unorm-storage'));
  }

  spareBytes(room: Room): number {
    return spareBytesOf(room);
  }

  bind(inputs: RasterizerInputs): void {
    this.#release();
    this.#inputs = inputs;
    this.#buffers = pairBuffers(this.#memory, inputs);
  }

  prepare(levers: PaintingLevers, format: GPUTextureFormat, ordered?: OrderedPainting): void {
    const variant = { isNoting: false, refusesLast: refusesLast(levers) };
    const prepare = (own: RasterizeVariant): unknown =>
      (ordered?.tilesKernel(own) ?? rasterizeKernel(this.#device, own)).prepare();
    if (this.finishes(format)) prepare({ ...variant, format, isFinal: true });
    prepare({ ...variant, format: this.#accumulation, isFinal: false });
  }

  /** Lists the splats for the bins. */
  prepareFrame(encoder: GPUCommandEncoder, { surface, levers, background, timer }: Painting): void {
    if (this.#inputs === undefined || this.#buffers === undefined) return;
    const buffers = this.#buffers;
    const bound = this.#gridFor(surface, this.#inputs, buffers);
    this.#writeView(surface, bound.grid, [0, 0], levers, background);

    const { count, plan, emit, index } = this.#kernels;
    const bin = encoder.beginComputePass({ label: 'gs.bin', timestampWrites: timer?.timestampWrites('bin') });
    // As many as there is room for: groups beyond the splats and pairs that are there end at once.
    const groups = groupsOf(this.#inputs.capacity);
    count.dispatch(bin, bound.count, groups);
    plan.dispatch(bin, bound.plan, 1);
    emit.dispatch(bin, bound.emit, groups);
    this.#sort.record(bin, bound.sort, this.#inputs.pairCapacity);
    index.dispatch(bin, bound.index, Math.ceil(this.#inputs.pairCapacity / PROJECT_GROUP));
    bin.end();
  }

  record(encoder: GPUCommandEncoder, painting: Painting, slice: Slice): void {
    const { surface, levers, background, auxiliary, survivors, timer, depth, depths, ordered } = painting;
    if (this.#inputs === undefined || this.#buffers === undefined) return;
    const bound = this.#gridFor(surface, this.#inputs, this.#buffers);
    const { format, width, height } = surface;
    const { column, row, columns, rows } = sliceOfTiles(Math.ceil(width / TILE), Math.ceil(height / TILE), slice);
    if (columns * rows === 0) return;
    // A whole frame has the view that its splats were listed with.
    if (slice.count > 1) this.#writeView(surface, bound.grid, [column, row], levers, background);
    const paint = encoder.beginComputePass({
      label: 'gs.rasterize',
      timestampWrites: timer?.timestampWrites('rasterize'),
    });
    const variant = {
      ...{ format, isFinal: background !== undefined, isNoting: auxiliary !== undefined },
      refusesLast: refusesLast(levers),
    };
    const kernel =
      ordered?.tilesKernel(variant, depth) ??
      (depth ? depth.tilesKernel(variant) : rasterizeKernel(this.#device, variant));
    const image =
      ordered?.bindTiles(kernel, this.#painted(bound, surface.view), depth) ??
      (depth && depths
        ? depth.bindTiles(kernel, this.#painted(bound, surface.view), depths)
        : auxiliary && survivors
          ? this.#bindNoting(kernel, bound, surface.view, { ...auxiliary, survivors })
          : this.#imageBindings(kernel, bound, surface.view));
    kernel.dispatchGrid(paint, image, columns, rows);
    paint.end();
  }

  destroy(): void {
    this.#nowhere?.depth.destroy();
    this.#memory.destroy();
  }

  #release(): void {
    // The spare ones are not of this memory, and stay.
    for (const buffer of Object.values(this.#buffers ?? {}).flat()) this.#memory.free(buffer as GPUBuffer);
    this.#forgetGrids();
    this.#buffers = undefined;
  }

  #gridFor({ width, height }: Surface, inputs: RasterizerInputs, buffers: PairBuffers): GridBindings {
    const columns = Math.ceil(width / BIN_WIDTH);
    const rows = Math.ceil(height / BIN_HEIGHT);
    const key = `${columns} x ${rows}`;
    const known = this.#bound.get(key);
    if (known) return known;
    if (this.#bound.size >= MAX_GRIDS) this.#forgetGrids();
    const bits = Math.ceil(Math.log2(columns * rows));
    const { storage, copyDestination } = BUFFER_USAGE;
    const ranges = this.#memory.buffer('gs.bin.ranges', 8 * columns * rows, storage | copyDestination);
    const bound = { grid: { columns, rows, bits }, ranges, ...this.#bindings(inputs, buffers, bits, ranges) };
    this.#bound.set(key, bound);
    return bound;
  }

  #forgetGrids(): void {
    for (const { ranges } of this.#bound.values()) this.#memory.free(ranges);
    this.#bound.clear();
  }

  #bindings(
    { plan, splats, order }: RasterizerInputs,
    { rects, groupPairs, plan: pairPlan, bins, pairs, digitCounts, digitTotals }: PairBuffers,
    bits: number,
    ranges: GPUBuffer,
  ): Omit<GridBindings, 'grid' | 'ranges'> {
    const view = this.#view;
    const sorted = sortedIn(bits);
    const { count, plan: planKernel, emit, index } = this.#kernels;
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
      rasterize: new WeakMap(),
    };
  }

  #imageBindings(kernel: RasterizeKernel, bound: GridBindings, image: GPUTextureView): GPUBindGroup {
    const known = bound.rasterize.get(image);
    if (known) return known;
    const made = kernel.bind(this.#painted(bound, image));
    bound.rasterize.set(image, made);
    return made;
  }

  #painted(bound: GridBindings, image: GPUTextureView) {
    const { splats } = this.#inputs!;
    const { pairs, bins } = this.#buffers!;
    const sorted = sortedIn(bound.grid.bits);
    return {
      view: this.#view,
      splats,
      pairs: pairs[sorted],
      ranges: bound.ranges,
      // Once the pairs are sorted, what they were sorted from is free.
      tile_bits: bins[1 - sorted]!,
      image,
    };
  }

  /** Bound anew for each frame: auxiliary outputs are not for every frame. */
  #bindNoting(
    kernel: RasterizeKernel,
    bound: GridBindings,
    image: GPUTextureView,
    { contributions, depth, survivors }: AuxiliaryOutputs & { readonly survivors: GPUBuffer },
  ): GPUBindGroup {
    this.#nowhere ??= {
      contributions: this.#memory.buffer('gs.rasterize.no_contributions', 4, BUFFER_USAGE.storage),
      depth: this.#device.createTexture({
        label: 'gs.rasterize.no_depth',
        size: [1, 1],
        format: 'r32float',
        usage: TEXTURE_USAGE.storageBinding,
      }),
    };
    return (kernel as unknown as ComputeKernel<typeof rasterizeTilesNoting>).bind({
      ...(this.#noted = { ...this.#painted(bound, image), survivors }),
      contributions: contributions ?? this.#nowhere.contributions,
      depths: (depth ?? this.#nowhere.depth).createView(),
    });
  }

  #writeView(
    { width, height }: Surface,
    { columns, rows }: Grid,
    first_tile: readonly [number, number],
    { transmittanceMin }: PaintingLevers,
    background: Painting['background'] = TRANSPARENT,
  ): void {
    const { capacity, pairCapacity } = this.#inputs!;
    const room = { pair_capacity: pairCapacity, splat_groups: groupsOf(capacity) };
    const image = { viewport: [width, height], bins: [columns, rows], background, first_tile };
    writeStruct(layouts.BinView, { ...room, ...image, transmittance_min: transmittanceMin }, this.#viewBytes);
    this.#device.queue.writeBuffer(this.#view, 0, this.#viewBytes);
  }
}
