import { boundsOf, GaussianSplatError, type Bounds, type FilterRule, type Vector3 } from '@gaussian-splat/core';
import type { GaussianLayout } from '@gaussian-splat/core/contract';
import { pageCapacity } from './gaussian-buffers.js';
import type { GaussianBlock } from './gaussian-scene.js';
import * as layouts from './generated/live-layouts.js';
import { BUFFER_USAGE } from './gpu/kernel.js';
import { type GpuMemory, withMemoryCheck } from './gpu/memory.js';
import { writeStruct } from './gpu/struct.js';
import { submitPass, writeUniform } from './gpu/one-off.js';
import { readBack } from './gpu/read-back.js';
import { readSamples } from './read-samples.js';
import { SceneBuffers } from './scene-buffers.js';
import { ingestStage } from './stages/ingest.js';
import { bytesPerSplat } from './memory-ledger.js';
import { cullGroups } from './stages/stage.js';
import { countBytes, ingestValues, TensorBindings } from './tensor-bindings.js';
import { CHUNK_NUMBERS, GEOMETRY_WORDS, shWords } from './pack/words.js';

/** Options of {@link DynamicGaussians.create}. `antialiased` is false by default. */
export interface DynamicGaussiansOptions extends Partial<FilterRule> {
  /** Upper limit of the GPU memory of the scene in bytes; default: no limit but the device's. */
  readonly memoryBudget?: number | undefined;
  /** World position of the local point (0, 0, 0) of the positions. Default (0, 0, 0). */
  readonly origin?: Vector3 | undefined;
}

const ORIGIN: Vector3 = [0, 0, 0];
/** Maximum number of sets of tensors with cached bindings. A generator cycles through a few output buffers. */
const MAX_BINDINGS = 8;

/** Statistics of a sample of the rows of a run. */
export interface RowSample {
  /** Bounds of the sampled rows with an opacity above 0. */
  readonly bounds: Bounds;
  /** Number of sampled rows with an opacity above 0. */
  readonly drawn: number;
  /** Number of sampled rows with unusable values: not finite, out of range, zero extent, or a zero rotation. */
  readonly unusable: number;
  /** Count of valid rows that the last run wrote, and its number of rows; absent for a layout without a count. */
  readonly counted?: { readonly count: number; readonly rows: number };
}

/** A block, and the resources that fill it. */
interface DynamicBlock extends GaussianBlock {
  /** Index of the block's first row among all rows. */
  readonly first: number;
  /** Uniform buffer with `Ingest` of shaders/ingest.wgsl. */
  readonly uniform: GPUBuffer;
}

/**
 * Gaussians that a generator rewrites at any rate, entirely on the GPU.
 *
 * ```ts
 * const gaussians = await DynamicGaussians.create(device, gaussianLayout(header, contract));
 * gaussians.ingest({ gaussians: tensorBuffer }, rows); // after every run
 * viewpoint.draw(camera, { target: texture });
 * ```
 *
 * The tensors of a run are one copy of the Gaussians; the packed blocks that are drawn are another. {@link ingest}
 * converts the tensors to the blocks in a single submission. Every frame therefore shows exactly one run, however long
 * the next run takes.
 */
export class DynamicGaussians extends SceneBuffers {
  readonly blocks: readonly DynamicBlock[];
  readonly layout: GaussianLayout;
  readonly #device: GPUDevice;
  readonly #stage: ReturnType<typeof ingestStage>;
  readonly #places: TensorBindings;
  readonly #bindings = new Map<string, readonly GPUBindGroup[]>();
  #version = 0;
  #rows = -1;
  #dropped = 0;
  /**
   * Rows of other scenes in front of the rows of this scene in each tensor. The offsets in the uniforms include them.
   */
  #before = 0;

  private constructor(
    device: GPUDevice,
    memory: GpuMemory,
    layout: GaussianLayout,
    { antialiased = false, filterVariance, memoryBudget, origin = ORIGIN }: DynamicGaussiansOptions,
  ) {
    const { capacity, shDegree = 0 } = layout;
    super(memory, { shDegree, antialiased, filterVariance, origin }, capacity);
    memory.reserve(whatOf(layout), capacity * bytesPerSplat(shDegree, this.shPrecision), memoryBudget);
    this.#device = device;
    this.layout = layout;
    this.#stage = ingestStage(device);
    this.#places = new TensorBindings(layout, memory);
    this.blocks = this.#makeBlocks();
    // An empty run makes all rows invisible.
    this.ingest({}, 0);
  }

  /**
   * Allocates memory for the largest output of a generator.
   * @param layout Layout that `gaussianLayout` of core returns.
   * @throws GaussianSplatError `out-of-memory/budget` before anything is allocated; `out-of-memory/allocation` if the
   * device has too little memory.
   */
  static async create(
    device: GPUDevice,
    layout: GaussianLayout,
    options: DynamicGaussiansOptions = {},
  ): Promise<DynamicGaussians> {
    return withMemoryCheck(device, whatOf(layout), (memory) => new DynamicGaussians(device, memory, layout, options));
  }

  /** Number of calls of {@link ingest} with rows, plus one. */
  get version(): number {
    return this.#version;
  }

  /**
   * Ingests the output of a run: encodes and submits one compute pass. Nothing is read back. No resource is created for
   * a set of buffers that was used before. Later submissions may overwrite the tensors.
   *
   * Rows beyond the count, and rows with unusable values, are not drawn.
   * @param tensors Storage buffers, keyed by the tensor names of the layout. The buffer of the count needs COPY_SRC.
   * Sizes of float16 tensors are rounded up to 4 bytes.
   * @param rows Number of rows that this run wrote: 0 to the capacity of the layout, or its padded rows. For 0 no
   * tensor is required.
   * @param instance Index of this scene in a run that wrote several scenes of `rows` rows in sequence to each tensor;
   * default 0. The count of valid rows is then element `instance` of its tensor.
   * @throws GaussianSplatError `contract/rows` if the rows exceed the capacity; `argument/value` for a missing or too
   * small tensor. The previous content remains.
   */
  ingest(tensors: Readonly<Record<string, GPUBuffer>>, rows: number, instance = 0): void {
    requireRows(rows, this.layout.paddedRows ?? this.count);
    const counter = rows > 0 && this.layout.count !== undefined ? tensors[this.layout.count] : undefined;
    this.#places.check(tensors, rows, instance);
    const before = instance * rows;
    const bindings = this.#bindingsOf(rows > 0 ? tensors : {}, before);
    this.#writeRows(rows);
    this.#writePlaces(before);
    const encoder = this.#device.createCommandEncoder({ label: 'gs.ingest' });
    if (counter) {
      const { offset } = layouts.Ingest.fields.count;
      for (const { uniform } of this.blocks)
        encoder.copyBufferToBuffer(counter, countBytes(this.layout) * instance, uniform, offset, 4);
    }
    const record = (pass: GPUComputePassEncoder): void =>
      this.blocks.forEach(({ count }, page) => this.#stage.record(pass, bindings[page], count));
    submitPass(this.#device, 'gs.ingest', record, encoder);
    this.#version++;
  }

  /**
   * Returns the bounds of the splats, from a sample of up to 65,536 of them. Reads back from the GPU: call it once to
   * frame a camera, not for every frame.
   */
  async readBounds(): Promise<Bounds> {
    return (await this.readSample()).bounds;
  }

  /** Returns statistics of a sample of up to 65,536 splats. Reads back from the GPU, as {@link readBounds} does. */
  async readSample(): Promise<RowSample> {
    const places = await readSamples(this.#device, this.blocks);
    this.#dropped = places.unusable;
    return {
      bounds: boundsOf({ ...places, origin: this.origin }),
      drawn: places.count,
      unusable: places.unusable,
      ...(this.layout.count === undefined ? {} : { counted: await this.#readCount() }),
    };
  }

  /** Reads the count of valid rows of the last run, and its number of rows. */
  async #readCount(): Promise<RowSample['counted']> {
    const byteOffset = layouts.Ingest.fields.count.offset;
    const [words] = await readBack(this.#device, [{ buffer: this.blocks[0].uniform, byteOffset, byteLength: 8 }]);
    const [count, rows] = new Int32Array(words);
    return { count, rows };
  }

  /** Number of rows with unusable values in the last sample; 0 before the first sample. */
  get droppedCount(): number {
    return this.#dropped;
  }

  override destroy(): void {
    this.#bindings.clear();
    super.destroy();
  }

  #makeBlocks(): DynamicBlock[] {
    const shStride = shWords(this.shDegree, this.shPrecision);
    const capacity = pageCapacity(this.#device, Math.max(4 * GEOMETRY_WORDS, 4 * shStride, this.#places.bytesPerRow));
    const { storage, uniform, copySource, copyDestination } = BUFFER_USAGE;
    const blocks: DynamicBlock[] = [];
    for (let first = 0; first < this.count; first += capacity) {
      const count = Math.min(capacity, this.count - first);
      const part = (name: string, words: number): GPUBuffer =>
        this.memory.buffer(`gs.ingest.${name}`, 4 * words, storage | copySource);
      const page = {
        first,
        count,
        geometry: part('geometry', GEOMETRY_WORDS * count),
        sh: part('sh', shStride * count),
        chunks: part('chunks', CHUNK_NUMBERS * cullGroups(count)),
        uniform: this.memory.buffer('gs.ingest.uniform', layouts.Ingest.size, uniform | copyDestination | copySource),
      };
      writeUniform(this.#device, page.uniform, layouts.Ingest, ingestValues(this.layout, first, count, 0));
      blocks.push(page);
    }
    return blocks;
  }

  /** Writes the number of rows of a run to the uniforms of all blocks. Without a count tensor, all rows are live. */
  #writeRows(rows: number): void {
    if (rows === this.#rows) return;
    this.#rows = rows;
    const { count, rows: rowsField } = layouts.Ingest.fields;
    if (rowsField.offset !== count.offset + 4) throw new Error('Ingest: rows must follow count');
    const words = Uint32Array.of(rows, rows);
    for (const { uniform } of this.blocks) this.#device.queue.writeBuffer(uniform, count.offset, words);
  }

  /**
   * Writes the offsets of a scene's rows in the tensors. The device requires aligned offsets of bindings; the uniform
   * contains the remaining offset from the binding to the rows.
   */
  #writePlaces(before: number): void {
    if (before === this.#before) return;
    this.#before = before;
    const bytes = new ArrayBuffer(layouts.Ingest.size);
    const { offset } = layouts.Ingest.fields.positions;
    for (const { uniform, first, count } of this.blocks) {
      writeStruct(layouts.Ingest, ingestValues(this.layout, first, count, before), bytes);
      this.#device.queue.writeBuffer(uniform, offset, bytes, offset);
    }
  }

  #bindingsOf(tensors: Readonly<Record<string, GPUBuffer>>, before: number): readonly GPUBindGroup[] {
    const key = `${before} ${this.#places.keyOf(tensors)}`;
    let bindings = this.#bindings.get(key);
    if (bindings === undefined) {
      if (this.#bindings.size >= MAX_BINDINGS) this.#bindings.clear();
      bindings = this.blocks.map((page) =>
        this.#stage.bind({
          ...this.#places.resources(tensors, page, before),
          ingest: page.uniform,
          gaussians: page.geometry,
          sh: page.sh,
          chunks: page.chunks,
        }),
      );
      this.#bindings.set(key, bindings);
    }
    return bindings;
  }
}

const whatOf = ({ capacity }: GaussianLayout): string => `generated scene of up to ${capacity} splats`;

function requireRows(rows: number, capacity: number): void {
  if (Number.isInteger(rows) && rows >= 0 && rows <= capacity) return;
  throw new GaussianSplatError('contract/rows', {
    where: 'a run of the generator',
    expected: `0 to ${capacity} rows, as the file or nMax of its contract says`,
    found: `${rows}`,
    remedy: 'raise nMax in the contract to the maximum number of rows of a run',
  });
}
