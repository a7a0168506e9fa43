import {
  binCount,
  binEmit,
  binGather,
  binPlan,
  constants,
  layouts,
  rasterizeTiles,
  scan,
} from '../generated/shaders.js';
import { BUFFER_USAGE, ComputeKernel, kernelOf, perDevice } from '../gpu/kernel.js';
import { GpuMemory } from '../gpu/memory.js';
import type { PassTimer } from '../gpu/pass-timer.js';
import { writeStruct } from '../gpu/struct.js';
import { planOffsets } from '../scratch.js';
import { sortedIn, SortStage, type SortBindings } from '../stages/sort.js';
import type { Accumulation, AccumulationFormat, Rasterizer, RasterizerInputs } from './rasterizer.js';

const { BIN_WIDTH, BIN_HEIGHT, TILE, PREFIX_THREADS, SORT_BLOCK, DIGITS } = constants;

/** Pairs of splat and bin for which there is room, for each splat that may be visible, and at least. */
const PAIRS_PER_SPLAT = 2;
const LEAST_PAIRS = 1 << 16;

/** Bins across and down of an image, and the bits of a bin's number. */
interface Grid {
  readonly columns: number;
  readonly rows: number;
  readonly bits: number;
}

/** Buffers whose size follows the scene. */
interface PairBuffers {
  readonly capacity: number;
  readonly rects: GPUBuffer;
  readonly groupPairs: GPUBuffer;
  readonly plan: GPUBuffer;
  readonly bins: readonly [GPUBuffer, GPUBuffer];
  readonly places: readonly [GPUBuffer, GPUBuffer];
  readonly pairs: GPUBuffer;
  readonly sortedPairs: GPUBuffer;
  readonly digitCounts: GPUBuffer;
  readonly digitTotals: GPUBuffer;
}

/** Everything that is bound for one scene and one image size. */
interface Bound {
  readonly accumulation: Accumulation;
  readonly grid: Grid;
  readonly ranges: GPUBuffer;
  readonly count: GPUBindGroup;
  readonly scan: GPUBindGroup;
  readonly plan: GPUBindGroup;
  readonly emit: GPUBindGroup;
  readonly sort: SortBindings;
  readonly gather: GPUBindGroup;
  readonly rasterize: GPUBindGroup;
}

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
  readonly #memory: GpuMemory;
  readonly #kernels: ReturnType<typeof makeKernels>;
  readonly #sort: SortStage;
  readonly #view: GPUBuffer;
  readonly #viewBytes = new ArrayBuffer(layouts.BinView.size);
  readonly #scanLength: GPUBuffer;
  #inputs: RasterizerInputs | undefined;
  #buffers: PairBuffers | undefined;
  #bound: Bound | undefined;

  constructor(device: GPUDevice, format: AccumulationFormat) {
    this.#device = device;
    this.#memory = new GpuMemory(device);
    this.#kernels = perDevice(device, `tiles ${format}`, () => makeKernels(device, format));
    this.#sort = new SortStage(device);
    const usage = BUFFER_USAGE.uniform | BUFFER_USAGE.copyDestination;
    this.#view = this.#memory.buffer('gs.rasterize.view', layouts.BinView.size, usage);
    this.#scanLength = this.#memory.buffer('gs.rasterize.scan_length', 16, usage);
  }

  get byteLength(): number {
    return this.#memory.byteLength;
  }

  bind(inputs: RasterizerInputs): void {
    this.#inputs = inputs;
    this.#release();
    this.#buffers = this.#allocate(inputs.capacity);
  }

  record(encoder: GPUCommandEncoder, accumulation: Accumulation, timer?: PassTimer): void {
    if (this.#inputs === undefined || this.#buffers === undefined) return;
    const { plan } = this.#inputs;
    const buffers = this.#buffers;
    const bound = this.#boundTo(accumulation, this.#inputs, buffers);
    this.#writeView(accumulation, bound.grid, buffers.capacity);
    encoder.clearBuffer(buffers.groupPairs);
    encoder.clearBuffer(bound.ranges);

    const { count, scan: scanKernel, plan: planKernel, emit, gather, rasterize } = this.#kernels;
    const bin = encoder.beginComputePass({ label: 'gs.bin', timestampWrites: timer?.timestampWrites('bin') });
    count.dispatchIndirect(bin, bound.count, plan, planOffsets.visible);
    scanKernel.dispatch(bin, bound.scan, 1);
    planKernel.dispatch(bin, bound.plan, 1);
    emit.dispatchIndirect(bin, bound.emit, plan, planOffsets.visible);
    this.#sort.record(bin, bound.sort, buffers.plan);
    gather.dispatchIndirect(bin, bound.gather, buffers.plan, planOffsets.visible);
    bin.end();
    const paint = encoder.beginComputePass({
      label: 'gs.rasterize',
      timestampWrites: timer?.timestampWrites('rasterize'),
    });
    const { width, height } = accumulation;
    rasterize.dispatchGrid(paint, bound.rasterize, Math.ceil(width / TILE), Math.ceil(height / TILE));
    paint.end();
  }

  destroy(): void {
    this.#memory.destroy();
  }

  #release(): void {
    for (const buffer of Object.values(this.#buffers ?? {}).flat()) {
      if (typeof buffer !== 'number') this.#memory.free(buffer);
    }
    if (this.#bound) this.#memory.free(this.#bound.ranges);
    this.#buffers = undefined;
    this.#bound = undefined;
  }

  #allocate(splats: number): PairBuffers {
    const { storage, copyDestination, copySource, indirect } = BUFFER_USAGE;
    const limit = Math.floor(this.#device.limits.maxStorageBufferBindingSize / layouts.BinPair.size);
    const capacity = Math.min(limit, Math.max(LEAST_PAIRS, PAIRS_PER_SPLAT * splats));
    const groups = Math.ceil(splats / PREFIX_THREADS);
    const buffer = (name: string, bytes: number): GPUBuffer =>
      this.#memory.buffer(`gs.bin.${name}`, bytes, storage | copySource | copyDestination | indirect);
    const pair = (name: string): [GPUBuffer, GPUBuffer] => [
      buffer(`${name}_a`, 4 * capacity),
      buffer(`${name}_b`, 4 * capacity),
    ];
    const groupPairs = buffer('group_pairs', 4 * (groups + 1));
    this.#device.queue.writeBuffer(this.#scanLength, 0, Uint32Array.of(groupPairs.size / 4 - 1));
    return {
      capacity,
      rects: buffer('rects', 4 * splats),
      groupPairs,
      plan: buffer('plan', layouts.Plan.size + layouts.PagePlan.size),
      bins: pair('bins'),
      places: pair('places'),
      pairs: buffer('pairs', layouts.BinPair.size * capacity),
      sortedPairs: buffer('sorted_pairs', layouts.BinPair.size * capacity),
      digitCounts: buffer('digit_counts', 4 * DIGITS * Math.ceil(capacity / SORT_BLOCK)),
      digitTotals: buffer('digit_totals', 4 * DIGITS),
    };
  }

  #boundTo(accumulation: Accumulation, inputs: RasterizerInputs, buffers: PairBuffers): Bound {
    if (this.#bound?.accumulation === accumulation) return this.#bound;
    if (this.#bound) this.#memory.free(this.#bound.ranges);
    const columns = Math.ceil(accumulation.width / BIN_WIDTH);
    const rows = Math.ceil(accumulation.height / BIN_HEIGHT);
    const bits = Math.ceil(Math.log2(columns * rows));
    const { storage, copyDestination } = BUFFER_USAGE;
    const ranges = this.#memory.buffer('gs.bin.ranges', 8 * columns * rows, storage | copyDestination);
    this.#bound = {
      accumulation,
      grid: { columns, rows, bits },
      ranges,
      ...this.#bindings(inputs, buffers, bits, ranges, accumulation),
    };
    return this.#bound;
  }

  #bindings(
    inputs: RasterizerInputs,
    buffers: PairBuffers,
    bits: number,
    ranges: GPUBuffer,
    accumulation: Accumulation,
  ): Omit<Bound, 'accumulation' | 'grid' | 'ranges'> {
    const { plan, splats, order } = inputs;
    const { rects, groupPairs, plan: pairPlan, bins, places, pairs, sortedPairs, digitCounts, digitTotals } = buffers;
    const view = this.#view;
    const result = sortedIn(bits);
    const { count, scan: scanKernel, plan: planKernel, emit, gather, rasterize } = this.#kernels;
    return {
      count: count.bind({ view, plan, splats, order, rects, group_pairs: groupPairs }),
      scan: scanKernel.bind({ values: groupPairs, scan: this.#scanLength }),
      plan: planKernel.bind({ view, group_pairs: groupPairs, pair_plan: pairPlan }),
      emit: emit.bind({ view, plan, splats, order, rects, group_pairs: groupPairs, bins: bins[0], pairs }),
      sort: this.#sort.bind({ plan: pairPlan, keys: bins, order: places, digitCounts, digitTotals }, bits),
      gather: gather.bind({
        pair_plan: pairPlan,
        bins: bins[result],
        places: places[result],
        pairs,
        sorted_pairs: sortedPairs,
        ranges,
      }),
      rasterize: rasterize.bind({ view, splats, sorted_pairs: sortedPairs, ranges, accumulated: accumulation.view }),
    };
  }

  #writeView({ width, height }: Accumulation, { columns, rows }: Grid, capacity: number): void {
    const values = { viewport: [width, height], bins: [columns, rows], pair_capacity: capacity };
    writeStruct(layouts.BinView, values, this.#viewBytes);
    this.#device.queue.writeBuffer(this.#view, 0, this.#viewBytes);
  }
}

function makeKernels(device: GPUDevice, format: AccumulationFormat) {
  return {
    count: kernelOf(device, binCount),
    scan: kernelOf(device, scan),
    plan: kernelOf(device, binPlan),
    emit: kernelOf(device, binEmit),
    gather: kernelOf(device, binGather),
    rasterize: new ComputeKernel(device, writingTo(format)),
  };
}

/** WGSL has no way to leave the format of a storage texture open. */
function writingTo(format: AccumulationFormat): typeof rasterizeTiles {
  const { accumulated } = rasterizeTiles.bindings;
  return {
    ...rasterizeTiles,
    bindings: { ...rasterizeTiles.bindings, accumulated: { ...accumulated, format } },
    code: rasterizeTiles.code.replace(accumulated.format, format),
  } as unknown as typeof rasterizeTiles;
}
