import { dot, type Camera, type Vector3 } from '@gaussian-splat/core';
import { constants, layouts } from './generated/shaders.js';
import { BUFFER_USAGE } from './gpu/kernel.js';
import { GpuMemory } from './gpu/memory.js';
import type { FrameTimer } from './gpu/pass-timer.js';
import type { PageTable } from './page-table.js';
import { OrderKeysStage } from './stages/order-keys.js';
import { SortStage } from './stages/sort.js';
import type { Threads } from './stages/plan.js';

const KEY_BITS = 32;
/** Times as far from a scene's origin, in depth, as a camera may have been for which an order was made that serves it: four bits of a depth's 24. */
const MOST_FARTHER = 16;
const { SORT_BLOCK, DIGITS, CULL_GROUP } = constants;

/** What a sort needs besides the order that it makes. */
interface Working {
  readonly memory: GpuMemory;
  readonly plan: GPUBuffer;
  /** Of each page. */
  readonly keys: readonly { readonly stage: OrderKeysStage; readonly bindings: GPUBindGroup }[];
  readonly sort: ReturnType<SortStage['bind']>;
}

/**
 * All splats of a page table from near to far. Depth along the camera's axis changes by the same amount for all splats when the
 * camera moves without turning, so the order stays right: such frames only thin it to the visible splats. One that was made from
 * far away has too few of float32's digits for a camera that is near.
 *
 * A splat's number counts pages as whole chunks; what fills up a page's last chunk stands at the end of the order.
 */
export class DepthOrder {
  readonly #device: GPUDevice;
  readonly #table: PageTable;
  readonly #sort: SortStage;
  readonly #memory: GpuMemory;
  #order: GPUBuffer | undefined;
  #axis: Vector3 | undefined;
  /** Of the scenes' origins, when the order was made. */
  #depths: readonly number[] = [];
  /** Of the content that was ordered. */
  #version = 0;
  /** Needed while sorting only. */
  #working: Working | undefined;

  constructor(device: GPUDevice, table: PageTable, threads: Threads) {
    this.#device = device;
    this.#table = table;
    this.#sort = new SortStage(device, threads);
    this.#memory = new GpuMemory(device);
  }

  /** Splats in the order. */
  get length(): number {
    return CULL_GROUP * this.#table.groups;
  }

  /** False if the device has no buffers large enough. */
  get isPossible(): boolean {
    const { maxBufferSize, maxStorageBufferBindingSize } = this.#device.limits;
    return this.length > 0 && 4 * this.length <= Math.min(maxBufferSize, maxStorageBufferBindingSize);
  }

  /** The numbers of the splats, from near to far; undefined before the first {@link record} and after {@link release}. */
  get order(): GPUBuffer | undefined {
    return this.#order;
  }

  /** True if there is what {@link settle} frees. */
  get isWorking(): boolean {
    return this.#working !== undefined;
  }

  get byteLength(): number {
    return this.#memory.byteLength + (this.#working?.memory.byteLength ?? 0);
  }

  /** True if the order serves the content at hand and a camera, whose axis may have turned by an angle in radians. */
  serves(camera: Camera, angle: number): boolean {
    if (this.#version !== this.#table.version) return false;
    const depths = depthsOf(this.#table.origins, camera);
    if (this.#depths.some((depth, k) => depth > MOST_FARTHER * depths[k])) return false;
    return this.#axis !== undefined && angleBetween(this.#axis, axisOf(camera)) <= angle;
  }

  /** Records the sorting of all splats for the camera that the table looks through. Call {@link settle} after submitting, unless there will be more to sort. */
  record(encoder: GPUCommandEncoder, camera: Camera, timer?: FrameTimer): void {
    this.#order ??= this.#memory.buffer('gs.order', 4 * this.length, BUFFER_USAGE.storage);
    const { plan, keys, sort } = (this.#working ??= this.#makeWorking(this.#order));
    this.#writePlan(plan);
    const pass = encoder.beginComputePass({ label: 'gs.order', timestampWrites: timer?.timestampWrites('order') });
    this.#table.pages.forEach(({ count }, page) => keys[page].stage.record(pass, keys[page].bindings, count));
    this.#sort.record(pass, sort, this.length);
    pass.end();
    this.#axis = axisOf(camera);
    this.#depths = depthsOf(this.#table.origins, camera);
    this.#version = this.#table.version;
  }

  /** Frees what only the sorting needed. */
  settle(): void {
    this.#working?.memory.destroy();
    this.#working = undefined;
  }

  /** Other pages have been laid out: the order is made anew when it is next of use. */
  forget(): void {
    this.settle();
    this.#axis = undefined;
    // Neither too small nor far too large.
    const needed = 4 * this.length;
    if (this.#order && (this.#order.size < needed || this.#order.size > 2 * needed)) this.release();
  }

  /** Gives the order up. */
  release(): void {
    this.settle();
    this.#memory.destroy();
    this.#order = undefined;
    this.#axis = undefined;
  }

  /** Buffers to sort in, and what the stages are bound to. */
  #makeWorking(order: GPUBuffer): Working {
    const { storage, copyDestination } = BUFFER_USAGE;
    const memory = new GpuMemory(this.#device);
    const buffer = (name: string, bytes: number): GPUBuffer =>
      memory.buffer(`gs.order.${name}`, bytes, storage | copyDestination);
    const blocks = this.#blocks;
    const keys = [buffer('keys_a', 4 * this.length), buffer('keys_b', 4 * this.length)] as const;
    const plan = buffer('plan', layouts.Plan.size + layouts.PagePlan.size);
    const buffers = {
      ...{ plan, keys, values: [order, buffer('values_b', 4 * this.length)] as const },
      digitCounts: buffer('digit_counts', 4 * DIGITS * blocks),
      digitTotals: buffer('digit_totals', 4 * DIGITS),
    };
    return {
      ...{ memory, plan, sort: this.#sort.bind(buffers, KEY_BITS) },
      keys: this.#table.pages.map(({ geometry, reading }, page) => {
        const stage = new OrderKeysStage(this.#device, reading);
        const view = this.#table.view(page);
        return { stage, bindings: stage.bind({ view, gaussians: geometry, keys: keys[0] }) };
      }),
    };
  }

  get #blocks(): number {
    return Math.ceil(this.length / SORT_BLOCK);
  }

  #writePlan(plan: GPUBuffer): void {
    const words = new Uint32Array(layouts.Plan.size / 4);
    const { visible, sort_blocks } = layouts.Plan.fields;
    words[visible.offset / 4] = this.length;
    words[sort_blocks.offset / 4] = this.#blocks;
    this.#device.queue.writeBuffer(plan, 0, words);
  }
}

/** How deep points lie, before or behind a camera. */
function depthsOf(points: readonly Vector3[], { worldToCamera: m }: Camera): number[] {
  return points.map(([x, y, z]) => Math.abs(m[8] * x + m[9] * y + m[10] * z + m[11]));
}

/** Unit vector along which a camera measures depth, in world coordinates. */
export function axisOf({ worldToCamera }: Camera): Vector3 {
  const [x, y, z] = [worldToCamera[8], worldToCamera[9], worldToCamera[10]];
  const length = Math.hypot(x, y, z);
  return [x / length, y / length, z / length];
}

/** Angle between two unit vectors, in radians; exact for tiny angles too. */
export function angleBetween(a: Vector3, b: Vector3): number {
  const chord = Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
  return dot(a, b) < 0 ? Math.PI : 2 * Math.asin(Math.min(1, chord / 2));
}
