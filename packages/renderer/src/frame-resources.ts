import { FrameBindings, type Stages } from './bindings.js';
import { CapacityHistory, type Capacity } from './capacity-history.js';
import { CapacityMonitor, CountBuffers, initialCapacity, MIN_CAPACITY } from './capacity.js';
import { BlockTable } from './page-table.js';
import type { Rasterizer } from './rasterizers/rasterizer.js';
import { maxPairs } from './rasterizers/pair-buffers.js';
import { maxVisible, Scratch } from './scratch.js';
import type { World } from './world.js';

/** Capacity in pairs with which the pacer can measure their cost. */
const TELLING_ROOM = 1 << 18;
/** Minimum usage of the capacity after scenes are removed; below it the capacity is released. */
const MIN_USED = 0.5;
/** Every frame may be divided into this many submissions: each takes the main thread a few tenths of a millisecond. */
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
  /** Pairs of splat and bin that are rasterized in one submission. */
  readonly pairsAtOnce: () => number;
  /** Called after an incomplete frame, when the next one has enough capacity. */
  readonly onIncomplete: () => void;
}

/** Manages the buffers between the stages for the current scenes, sized by the visible part of them. */
export class FrameResources {
  readonly #device: GPUDevice;
  readonly #options: ResourceOptions;
  #current: Resources | undefined;
  #counts: CountBuffers | undefined;
  #capacity: Capacity | undefined;
  #memory = new CapacityHistory();
  #hasOtherPairs = false;
  /** The current binding of the rasterizer to the buffers that may be replaced. */
  #boundPlan: GPUBuffer | undefined;
  #hasQuickPairs = false;
  /** Largest splat budget of any frame. */
  #maxSplats: number | undefined;

  constructor(device: GPUDevice, options: ResourceOptions) {
    this.#device = device;
    this.#options = options;
  }

  /** Resources of the last frame; undefined before the first. */
  get current(): Resources | undefined {
    return this.#current;
  }

  /** Capacity in pairs of splat and bin; 0 before the first frame. */
  get pairCapacity(): number {
    return this.#capacity?.pairs ?? 0;
  }

  get byteLength(): number {
    const { table, scratch } = this.#current ?? {};
    return [table, scratch].reduce((sum, part) => sum + (part?.byteLength ?? 0), 0);
  }

  /**
   * Returns the resources of a frame; allocates if the scenes or the requested capacity have changed.
   * @param splatBudget Maximum number of splats in the frame; 0 for no limit.
   */
  fit(world: World, splatBudget: number): Resources {
    this.#roomFor(splatBudget);
    const current = this.#current;
    if (current?.table.isCurrent) {
      // The monitor has requested another capacity.
      const hasOtherRoom = current.scratch.capacity !== this.#capacity?.visible || this.#hasOtherPairs;
      return hasOtherRoom ? this.#rebind(current.table) : current;
    }
    if (current) return this.#layoutAgain(current);
    const table = new BlockTable(this.#device, world);
    this.#capacity = this.#firstFor(table);
    this.#memory = new CapacityHistory();
    return this.#rebind(table);
  }

  /** The set of scenes has changed: buffers that are large enough stay, the others grow by the size of the new scenes. */
  #layoutAgain({ table }: Resources): Resources {
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
    this.#hasOtherPairs = this.#capacity.pairs !== now.pairs;
    this.#memory = new CapacityHistory();
    return this.#rebind(table);
  }

  /** Capacity in visible splats if `coming` more may become visible, including unused capacity. */
  #visibleWith(coming: number, max: Capacity): number {
    const { visible } = this.#capacity!;
    const { lastNeed } = this.#memory;
    if (lastNeed && lastNeed.visible + coming <= visible) return visible;
    return Math.min(max.visible, visible + coming);
  }

  /** Frees everything. */
  release(): void {
    const { table, scratch, monitor } = this.#current ?? {};
    table?.destroy();
    scratch?.destroy();
    monitor?.destroy();
    this.#counts?.destroy();
    this.#counts = undefined;
    this.#current = undefined;
    this.#boundPlan = undefined;
  }

  /** A larger splat budget than before requires another capacity. */
  #roomFor(splatBudget: number): void {
    const max = splatBudget > 0 ? splatBudget : Infinity;
    if (this.#maxSplats !== undefined && max > this.#maxSplats) this.release();
    this.#maxSplats = Math.max(this.#maxSplats ?? 0, max);
  }

  #maxFor(table: BlockTable): Capacity {
    const budget = table.hasDetail ? (this.#maxSplats ?? Infinity) : Infinity;
    return { visible: Math.min(table.splats, budget, maxVisible(this.#device)), pairs: maxPairs(this.#device) };
  }

  #firstFor(table: BlockTable): Capacity {
    return initialCapacity(table.splats, this.#maxFor(table), this.#isBudgeted(table));
  }

  #isBudgeted(table: BlockTable): boolean {
    return table.isStreamed && Number.isFinite(this.#maxSplats);
  }

  /**
   * A streamed scene with a budget keeps its initial capacity, because a flight may turn from a near wall to the whole
   * scene within a frame. It keeps the capacity for pairs, which determines the number of submissions, once a few
   * submissions are known to be enough.
   */
  #minFor(table: BlockTable): Capacity {
    if (!this.#isBudgeted(table)) return MIN_CAPACITY;
    const { visible, pairs } = this.#firstFor(table);
    // Never reset, because an alternating capacity would be reallocated each time.
    this.#hasQuickPairs ||= FEW_SUBMISSIONS * this.#options.pairsAtOnce() >= pairs;
    return { visible, pairs: this.#hasQuickPairs ? pairs : Math.min(pairs, TELLING_ROOM) };
  }

  /** Allocates and binds the buffers between the stages, for the current capacity. */
  #rebind(table: BlockTable): Resources {
    const { stages } = this.#options;
    const capacity = this.#capacity!;
    const kept = this.#current?.scratch.capacity === capacity.visible ? this.#current.scratch : undefined;
    if (kept === undefined) this.#current?.scratch.destroy();
    const pages = table.pages.length;
    const { visible, pairs } = capacity;
    const pingPongBytes = this.#options.rasterizer.pingPongBytes({ capacity: visible, pairCapacity: pairs });
    kept?.fitPingPong(pingPongBytes);
    kept?.fitPages(table.groups, pages);
    const scratch = kept ?? new Scratch(this.#device, { visible, groups: table.groups, pages }, pingPongBytes);
    const isSame = kept !== undefined && kept.plan === this.#boundPlan;
    if (!isSame || this.#hasOtherPairs) this.#bindRasterizer(scratch, capacity);
    this.#boundPlan = scratch.plan;
    this.#hasOtherPairs = false;
    const bindings = new FrameBindings(stages, { table, scratch });
    const monitor = this.#watch(table, capacity);
    this.#current = { table, scratch, bindings, monitor };
    return this.#current;
  }

  #bindRasterizer({ plan, splats, order, pingPong }: Scratch, { visible, pairs }: Capacity): void {
    this.#options.rasterizer.bind({
      plan,
      splats,
      pingPong,
      order: order[0],
      capacity: visible,
      pairCapacity: pairs,
    });
  }

  #watch(table: BlockTable, capacity: Capacity): CapacityMonitor {
    const bounds = { min: () => this.#minFor(table), max: this.#maxFor(table) };
    this.#current?.monitor.destroy();
    this.#counts ??= new CountBuffers(this.#device);
    return new CapacityMonitor(this.#counts, capacity, bounds, this.#memory, (requested, overflowed) => {
      this.#hasOtherPairs = requested.pairs !== this.#capacity?.pairs;
      this.#capacity = requested;
      if (overflowed) this.#options.onIncomplete();
    });
  }
}
