import { FrameBindings, type Stages } from './bindings.js';
import { CapacityHistory, larger, type Capacity } from './capacity-history.js';
import { CapacityMonitor, CountBuffers, initialCapacity, MIN_CAPACITY } from './capacity.js';
import { BlockTable } from './block-table.js';
import type { Rasterizer } from './rasterizers/rasterizer.js';
import { maxPairs } from './rasterizers/pair-buffers.js';
import { maxVisible, Scratch } from './scratch.js';
import type { World } from './world.js';

/** Minimum capacity in pairs that lets the pacer measure the cost of a pair. */
const TELLING_ROOM = 1 << 18;
/**
 * Minimum usage of the capacity, as a fraction, after scenes are removed. Below it the buffers are replaced by smaller
 * ones.
 */
const MIN_USED = 0.5;
/**
 * Maximum number of submissions into which every frame may be divided. Each costs a few tenths of a millisecond on the
 * main thread.
 */
const FEW_SUBMISSIONS = 4;

/** GPU resources between the stages for a set of scenes. */
export interface Resources {
  readonly table: BlockTable;
  readonly scratch: Scratch;
  readonly bindings: FrameBindings;
  readonly monitor: CapacityMonitor;
}

export interface ResourceOptions {
  readonly stages: Stages;
  readonly rasterizer: Rasterizer;
  /** Returns the number of pairs of splat and bin that are rasterized in one submission. */
  readonly pairsAtOnce: () => number;
  /** Called after a frame that lacked splats or pairs, when the next frame has enough capacity. */
  readonly onIncomplete: () => void;
}

/** Manages the buffers between the stages for the current scenes. Their size follows the number of visible splats. */
export class FrameResources {
  readonly #device: GPUDevice;
  readonly #options: ResourceOptions;
  #current: Resources | undefined;
  #counts: CountBuffers | undefined;
  #capacity: Capacity | undefined;
  #memory = new CapacityHistory();
  /** Plan buffer that the rasterizer is bound to. Another scratch or another number of blocks replaces it. */
  #boundPlan: GPUBuffer | undefined;
  /** Capacity in pairs that the rasterizer is bound with. */
  #boundPairs = 0;
  #hasQuickPairs = false;
  /** Largest splat budget of any frame: Infinity for no limit; undefined before the first frame. */
  #maxSplats: number | undefined;

  constructor(device: GPUDevice, options: ResourceOptions) {
    this.#device = device;
    this.#options = options;
  }

  /** Resources of the last frame; undefined before the first frame. */
  get current(): Resources | undefined {
    return this.#current;
  }

  /** Capacity in pairs of splat and bin; 0 before the first frame. */
  get pairCapacity(): number {
    return this.#capacity?.pairs ?? 0;
  }

  get byteLength(): number {
    const current = this.#current;
    return current ? current.table.byteLength + current.scratch.byteLength : 0;
  }

  /**
   * Returns the resources of a frame. Allocates if the scenes or the requested capacity have changed.
   * @param splatBudget Maximum number of splats in the frame; 0 for no limit.
   */
  fit(world: World, splatBudget: number): Resources {
    const isLarger = this.#admit(splatBudget);
    const current = this.#current;
    if (current) {
      const [{ table, scratch }, isLaid] = [current, current.table.isCurrent];
      if (!isLaid) this.#layoutAgain(table);
      if (isLarger) this.#capacity = larger(this.#capacity!, this.#firstFor(table));
      const { visible, pairs } = this.#capacity!;
      const isBound = isLaid && !isLarger && scratch.capacity === visible && this.#boundPairs === pairs;
      return isBound ? current : this.#rebind(table);
    }
    const table = new BlockTable(this.#device, world);
    this.#capacity = this.#firstFor(table);
    this.#memory = new CapacityHistory();
    return this.#rebind(table);
  }

  /**
   * Adapts the resources to another set of scenes. A capacity changes only if it is too small for these scenes, or if
   * they need less than {@link MIN_USED} of it.
   */
  #layoutAgain(table: BlockTable): void {
    const before = table.splats;
    table.lay();
    const [now, max, first] = [this.#capacity!, this.#maxFor(table), this.#firstFor(table)];
    const added = table.splats - before;
    const visible =
      added > 0
        ? this.#visibleWith(initialCapacity(added, max, this.#isBudgeted(table)).visible, max)
        : Math.min(now.visible, first.visible);
    const pairs = added > 0 ? Math.max(now.pairs, first.pairs) : Math.min(now.pairs, first.pairs);
    const isEnough = (own: number, wanted: number): boolean => wanted <= own && wanted >= own * MIN_USED;
    this.#capacity = {
      visible: isEnough(now.visible, visible) ? now.visible : visible,
      pairs: isEnough(now.pairs, pairs) ? now.pairs : pairs,
    };
    this.#memory = new CapacityHistory();
  }

  /** Returns the capacity in visible splats after `coming` more splats may become visible. Unused capacity counts. */
  #visibleWith(coming: number, max: Capacity): number {
    const { visible } = this.#capacity!;
    const { lastNeed } = this.#memory;
    if (lastNeed && lastNeed.visible + coming <= visible) return visible;
    return Math.min(max.visible, visible + coming);
  }

  /** Destroys all resources. */
  release(): void {
    const { table, scratch, monitor } = this.#current ?? {};
    table?.destroy();
    scratch?.destroy();
    monitor?.destroy();
    this.#counts?.destroy();
    this.#counts = this.#current = this.#boundPlan = undefined;
  }

  /** Records a splat budget. @returns Whether it is larger than all earlier ones, so that it requires another capacity. */
  #admit(splatBudget: number): boolean {
    const before = this.#maxSplats ?? 0;
    this.#maxSplats = Math.max(before, splatBudget || Infinity);
    return this.#maxSplats > before;
  }

  #maxFor(table: BlockTable): Capacity {
    // A splat budget can only limit the splats of blocks with levels of detail.
    const plain = table.blocks.reduce((sum, { count, details }) => (details ? sum : sum + count), 0);
    const max = Math.min(table.splats, plain + (this.#maxSplats ?? Infinity), maxVisible(this.#device));
    return { visible: max, pairs: maxPairs(this.#device) };
  }

  #firstFor(table: BlockTable): Capacity {
    return initialCapacity(table.splats, this.#maxFor(table), this.#isBudgeted(table));
  }

  #isBudgeted(table: BlockTable): boolean {
    return table.isStreamed && Number.isFinite(this.#maxSplats);
  }

  /**
   * Returns the minimum capacity. A streamed scene with a budget keeps its initial capacity for splats, because a
   * flight may turn from a near wall to the whole scene within a frame. It keeps the initial capacity for pairs once
   * {@link FEW_SUBMISSIONS} submissions are known to be enough.
   */
  #minFor(table: BlockTable): Capacity {
    if (!this.#isBudgeted(table)) return MIN_CAPACITY;
    const { visible, pairs } = this.#firstFor(table);
    // Never set back to false, because an alternating capacity would be reallocated each time.
    this.#hasQuickPairs ||= FEW_SUBMISSIONS * this.#options.pairsAtOnce() >= pairs;
    return { visible, pairs: this.#hasQuickPairs ? pairs : Math.min(pairs, TELLING_ROOM) };
  }

  /**
   * Allocates and binds the buffers between the stages for the current capacity. Buffers of the right size are kept.
   */
  #rebind(table: BlockTable): Resources {
    const { stages, rasterizer } = this.#options;
    const capacity = this.#capacity!;
    const kept = this.#current?.scratch.capacity === capacity.visible ? this.#current.scratch : undefined;
    if (kept === undefined) this.#current?.scratch.destroy();
    const pages = table.blocks.length;
    const { visible, pairs } = capacity;
    const room = { capacity: visible, pairCapacity: pairs };
    const pingPongBytes = rasterizer.pingPongBytes(room);
    kept?.fitPingPong(pingPongBytes);
    kept?.fitPages(table.groups, pages);
    const scratch = kept ?? new Scratch(this.#device, { visible, groups: table.groups, pages }, pingPongBytes);
    const { plan, splats, order, pingPong } = scratch;
    if (plan !== this.#boundPlan || pairs !== this.#boundPairs)
      rasterizer.bind({ ...room, plan, splats, pingPong, order: order[0] });
    this.#boundPlan = plan;
    this.#boundPairs = pairs;
    const bindings = new FrameBindings(stages, { table, scratch });
    const monitor = this.#watch(table, capacity);
    this.#current = { table, scratch, bindings, monitor };
    return this.#current;
  }

  #watch(table: BlockTable, capacity: Capacity): CapacityMonitor {
    this.#current?.monitor.destroy();
    this.#counts ??= new CountBuffers(this.#device);
    const bounds = { min: () => this.#minFor(table), max: this.#maxFor(table) };
    return new CapacityMonitor(this.#counts, capacity, bounds, this.#memory, (requested, overflowed) => {
      this.#capacity = requested;
      if (overflowed) this.#options.onIncomplete();
    });
  }
}
