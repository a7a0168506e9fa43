import { shCoefficientCount, type FilterRule, type ShDegree, type Vector3 } from '@gaussian-splat/core';
import type { GaussianAttribute, GaussianLayout } from '@gaussian-splat/core/contract';
import { DynamicGaussians } from './dynamic-gaussians.js';
import type { UploadOptions } from './gaussian-buffers.js';
import type { GaussianBlock, GaussianScene } from './gaussian-scene.js';
import { BUFFER_USAGE } from './gpu/kernel.js';
import { type GpuMemory, withMemoryCheck } from './gpu/memory.js';
import { constants } from './generated/shaders.js';
import type { ShPrecision } from './pack/words.js';

/** Number of words after which an upload waits for the GPU: 4 MB, a few milliseconds. */
const WORDS_AT_ONCE = 1 << 20;
/** Factor of the capacity over the number of splats at the allocation, because training adds splats. */
const HEADROOM = 1.25;

/** Meaning of the arrays of a scene. */
export interface ArrayLayout extends FilterRule {
  /** Degree of the harmonics; undefined for plain colors. */
  readonly shDegree: ShDegree | undefined;
  /** Whether scales are logarithms, and opacities logits. */
  readonly raw: boolean;
  /** World position of the local point (0, 0, 0) of the positions. */
  readonly origin: Vector3;
}

/** Attributes of a scene, one array each. `colors` and `sh` exclude each other. */
type ArrayAttribute = Exclude<GaussianAttribute, 'covariances'>;

/**
 * Gaussians whose attributes a page replaces at any rate, from float32 arrays. The arrays are uploaded as they are, and
 * the GPU packs them. Nothing is allocated while the splats fit the capacity.
 *
 * {@link write} changes no frame. {@link show} makes all that was written visible at once.
 */
export class ArrayGaussians implements GaussianScene {
  /** Capacity in splats. */
  readonly count: number;
  readonly shDegree: ShDegree;
  readonly shPrecision: ShPrecision;
  readonly antialiased: boolean;
  readonly filterVariance: number | undefined;
  readonly origin: Vector3;
  readonly blocks: readonly GaussianBlock[];
  readonly byteLength: number;
  readonly #layout: ArrayLayout;
  readonly #gaussians: DynamicGaussians;
  readonly #tensors: Tensors;
  #frameCount = 0;
  #droppedCount = 0;

  private constructor(layout: ArrayLayout, gaussians: DynamicGaussians, tensors: Tensors) {
    this.#layout = layout;
    this.#gaussians = gaussians;
    this.#tensors = tensors;
    ({ count: this.count, shDegree: this.shDegree, shPrecision: this.shPrecision, blocks: this.blocks } = gaussians);
    ({ antialiased: this.antialiased, filterVariance: this.filterVariance, origin: this.origin } = gaussians);
    this.byteLength = gaussians.byteLength + tensors.memory.byteLength;
  }

  /**
   * Allocates memory for 1.25 times `count` splats.
   * @throws GaussianSplatError `out-of-memory/budget` before anything is allocated; `out-of-memory/allocation` if the
   * device has too little memory.
   */
  static async create(
    device: GPUDevice,
    count: number,
    layout: ArrayLayout,
    { memoryBudget = Infinity }: UploadOptions = {},
  ): Promise<ArrayGaussians> {
    const { CULL_GROUP } = constants;
    const capacity = CULL_GROUP * Math.max(1, Math.ceil((HEADROOM * count) / CULL_GROUP));
    const slices = slicesOf(layout);
    const bytes = capacity * slices.reduce((sum, { components }) => sum + 4 * components, 0);
    const rest = { ...layout, memoryBudget: memoryBudget - bytes };
    const gaussians = await DynamicGaussians.create(device, tensorLayout(capacity, layout, slices), rest);
    try {
      const tensors = await withMemoryCheck(device, `arrays of ${capacity} splats`, (memory) => {
        memory.reserve(`arrays of ${capacity} splats`, bytes);
        return new Tensors(device, memory, capacity, slices);
      });
      return new ArrayGaussians(layout, gaussians, tensors);
    } catch (error) {
      gaussians.destroy();
      throw error;
    }
  }

  /** Number of splats that the last {@link show} has shown. */
  get frameCount(): number {
    return this.#frameCount;
  }

  /** Number of splats of the last {@link show} that were not drawn because of unusable values, as its caller counted. */
  get droppedCount(): number {
    return this.#droppedCount;
  }

  get version(): number {
    return this.#gaussians.version;
  }

  /** Whether the splats of a layout fit the capacity, and are packed as those of this scene. */
  fits(count: number, layout: ArrayLayout): boolean {
    const names = ['shDegree', 'raw', 'antialiased', 'filterVariance'] as const;
    const isSame = names.every((name) => layout[name] === this.#layout[name]);
    return count <= this.count && isSame && layout.origin.every((x, axis) => x === this.origin[axis]);
  }

  /**
   * Uploads values of an attribute, from splat `first` on. Every 4 MB it waits for the GPU, because a browser blocks the
   * thread if more bytes are in transit than its transfer buffer can hold. The values must not change before the promise
   * is fulfilled.
   */
  write(name: ArrayAttribute, first: number, values: Float32Array): Promise<void> {
    return this.#tensors.write(name, first, values);
  }

  /**
   * Shows the first `count` splats, as they are written, in subsequent submissions.
   * @param droppedCount Number of them with unusable values, which are not drawn, for statistics.
   */
  show(count: number, droppedCount = 0): void {
    this.#frameCount = count - droppedCount;
    this.#droppedCount = droppedCount;
    this.#gaussians.ingest(this.#tensors.buffers, count);
  }

  destroy(): void {
    this.#tensors.destroy();
    this.#gaussians.destroy();
  }
}

type Slice = GaussianLayout['attributes'][number];

const slicesOf = ({ shDegree, raw }: ArrayLayout): readonly Slice[] => {
  const slice = (attribute: ArrayAttribute, components: number, more: Partial<Slice> = {}): Slice => ({
    ...{ attribute, tensor: attribute, offset: 0, components, rowStride: components, activation: 'linear' },
    ...more,
  });
  return [
    slice('positions', 3),
    slice('scales', 3, raw ? { activation: 'log' } : {}),
    slice('rotations', 4, { quaternionOrder: 'wxyz' }),
    slice('opacities', 1, raw ? { activation: 'logit' } : {}),
    shDegree === undefined
      ? slice('colors', 3)
      : slice('sh', 3 * shCoefficientCount(shDegree), { shOrder: 'coefficient-major' }),
  ];
};

const tensorLayout = (capacity: number, { shDegree }: ArrayLayout, attributes: readonly Slice[]): GaussianLayout => ({
  capacity,
  isDynamic: true,
  dtype: 'float32',
  shDegree,
  attributes,
  count: undefined,
});

/** The arrays on the GPU. */
class Tensors {
  readonly memory: GpuMemory;
  readonly buffers: Readonly<Record<string, GPUBuffer>>;
  readonly #slices: readonly Slice[];
  readonly #queue: GPUQueue;
  /** Number of words until the next wait. */
  #left = WORDS_AT_ONCE;
  #isDestroyed = false;

  constructor(device: GPUDevice, memory: GpuMemory, capacity: number, slices: readonly Slice[]) {
    this.memory = memory;
    this.#slices = slices;
    this.#queue = device.queue;
    const usage = BUFFER_USAGE.storage | BUFFER_USAGE.copyDestination;
    this.buffers = Object.fromEntries(
      slices.map(({ tensor, components }) => [
        tensor,
        memory.buffer(`gs.arrays.${tensor}`, 4 * components * capacity, usage),
      ]),
    );
  }

  async write(name: ArrayAttribute, first: number, values: Float32Array): Promise<void> {
    const { components } = this.#slices.find(({ tensor }) => tensor === name)!;
    const words = new Uint32Array(values.buffer as ArrayBuffer, values.byteOffset, values.length);
    for (let at = 0; at < words.length && !this.#isDestroyed;) {
      const count = Math.min(this.#left, words.length - at);
      this.#queue.writeBuffer(this.buffers[name], 4 * (components * first + at), words, at, count);
      [at, this.#left] = [at + count, this.#left - count];
      if (this.#left > 0) continue;
      await this.#queue.onSubmittedWorkDone().catch(() => undefined);
      this.#left = WORDS_AT_ONCE;
    }
  }

  destroy(): void {
    this.#isDestroyed = true;
    this.memory.destroy();
  }
}
