import { FrameBindings, type Stages } from './bindings.js';
import { CapacityHistory, type Capacity } from './capacity-history.js';
import { CapacityMonitor, CountBuffers, initialCapacity, LEAST_CAPACITY } from './capacity.js';
import { PageTable } from './page-table.js';
import type { Rasterizer } from './rasterizers/rasterizer.js';
import { maxPairs } from './rasterizers/pair-buffers.js';
import { maxVisible, Scratch } from './scratch.js';
import type { World } from './world.js';

/** Room for pairs that the pacer learns from what one costs. */
const TELLING_ROOM = 1 << 18;
/** Share of the room that scenes which are left must need: else it is given back. */
const LEAST_USED = 0.5;
/** Submissions that painting a frame may always be divided into: each takes the page's thread some tenths of a millisecond. */
const FEW_SUBMISSIONS = 4;

/** What a set of scenes needs on the GPU between the stages. */
export interface Resources {
  readonly table: PageTable;
  readonly scratch: Scratch;
  readonly bindings: FrameBindings;
  readonly monitor: CapacityMonitor;
}

export interface ResourceOptions {
  readonly stages: Stages;
  readonly rasterizer: Rasterizer;
  /** Pairs of splat and bin that are painted in one submission. */
  readonly pairsAtOnce: () => number;
  /** A frame lacked room, and the next one has it. */
  readonly onIncomplete: () => void;
}

/** Sees to buffers between the stages for the scenes at hand, as large as what is visible of them needs. */
export class FrameResources {
  readonly #device: GPUDevice;
  readonly #options: ResourceOptions;
  #current: Resources | undefined;
  #counts: CountBuffers | undefined;
  #capacity: Capacity | undefined;
  #memory = new CapacityHistory();
  #hasOtherPairs = false;
  /** What the rasterizer was last bound to, of what may be replaced. */
  #boundPlan: GPUBuffer | undefined;
  #hasQuickPairs = false;
  /** The largest budget of splats that a frame has been given. */
  #mostSplats: number | undefined;

  constructor(device: GPUDevice, options: ResourceOptions) {
    this.#device = device;
    this.#options = options;
  }

  /** What the last frame was drawn with; undefined before the first. */
  get current(): Resources | undefined {
    return this.#current;
  }

  /** Pairs of splat and bin for which there is room; 0 before the first frame. */
  get pairCapacity(): number {
    return this.#capacity?.pairs ?? 0;
  }

  get byteLength(): number {
    const { table, scratch } = this.#current ?? {};
    return [table, scratch].reduce((sum, part) => sum + (part?.byteLength ?? 0), 0);
  }

  /**
   * What a frame is drawn with: allocates where the scenes or the wished room are other ones than before.
   * @param splatBudget most splats that the frame draws; 0 for no limit
   */
  fit(world: World, splatBudget: number): Resources {
    this.#roomFor(splatBudget);
    const current = this.#current;
    if (current?.table.isCurrent) {
      // The monitor has asked for other room.
      const hasOtherRoom = current.scratch.capacity !== this.#capacity?.visible || this.#hasOtherPairs;
      return hasOtherRoom ? this.#rebind(current.table) : current;
    }
    if (current) return this.#layAnew(current);
    const table = new PageTable(this.#device, world);
    this.#capacity = this.#firstFor(table);
    this.#memory = new CapacityHistory();
    return this.#rebind(table);
  }

  /** Scenes have come or gone: what still has room stays, what has not is made larger by what came. */
  #layAnew({ table }: Resources): Resources {
    const before = table.splats;
    table.lay();
    const [now, most, first] = [this.#capacity!, this.#mostFor(table), this.#firstFor(table)];
    const added = table.splats - before;
    const visible =
      added > 0
        ? this.#visibleWith(initialCapacity(added, most, this.#isBudgeted(table)).visible, most)
        : Math.min(now.visible, first.visible);
    const pairs = added > 0 ? Math.max(now.pairs, first.pairs) : Math.min(now.pairs, first.pairs);
    const isEnough = (own: number, wanted: number): boolean => wanted <= own && wanted >= own * LEAST_USED;
    this.#capacity = {
      visible: isEnough(now.visible, visible) ? now.visible : visible,
      pairs: isEnough(now.pairs, pairs) ? now.pairs : pairs,
    };
    this.#hasOtherPairs = this.#capacity.pairs !== now.pairs;
    this.#memory = new CapacityHistory();
    return this.#rebind(table);
  }

  /** Visible splats to have room for when `coming` more may be visible. Room that is empty counts. */
  #visibleWith(coming: number, most: Capacity): number {
    const { visible } = this.#capacity!;
    const { lastNeed } = this.#memory;
    if (lastNeed && lastNeed.visible + coming <= visible) return visible;
    return Math.min(most.visible, visible + coming);
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

  /** A larger budget of splats than before makes other room. */
  #roomFor(splatBudget: number): void {
    const most = splatBudget > 0 ? splatBudget : Infinity;
    if (this.#mostSplats !== undefined && most > this.#mostSplats) this.release();
    this.#mostSplats = Math.max(this.#mostSplats ?? 0, most);
  }

  #mostFor(table: PageTable): Capacity {
    const budget = table.hasDetail ? (this.#mostSplats ?? Infinity) : Infinity;
    return { visible: Math.min(table.splats, budget, maxVisible(this.#device)), pairs: maxPairs(this.#device) };
  }

  #firstFor(table: PageTable): Capacity {
    return initialCapacity(table.splats, this.#mostFor(table), this.#isBudgeted(table));
  }

  #isBudgeted(table: PageTable): boolean {
    return table.isStreamed && Number.isFinite(this.#mostSplats);
  }

  /**
   * A streamed scene within a budget keeps the room that it is given at first: flights turn from a near wall to everything within a frame. That for pairs, by which the painting
   * is divided, it keeps as soon as a few submissions are known to paint them all.
   */
  #leastFor(table: PageTable): Capacity {
    if (!this.#isBudgeted(table)) return LEAST_CAPACITY;
    const { visible, pairs } = this.#firstFor(table);
    // Never taken back: room that comes and goes would be allocated each time.
    this.#hasQuickPairs ||= FEW_SUBMISSIONS * this.#options.pairsAtOnce() >= pairs;
    return { visible, pairs: this.#hasQuickPairs ? pairs : Math.min(pairs, TELLING_ROOM) };
  }

  /** Allocates and binds what lies between the stages, for the capacity at hand. */
  #rebind(table: PageTable): Resources {
    const { stages } = this.#options;
    const capacity = this.#capacity!;
    const kept = this.#current?.scratch.capacity === capacity.visible ? this.#current.scratch : undefined;
    if (kept === undefined) this.#current?.scratch.destroy();
    const pages = table.pages.length;
    const { visible, pairs } = capacity;
    const spareBytes = this.#options.rasterizer.spareBytes({ capacity: visible, pairCapacity: pairs });
    kept?.fitSpare(spareBytes);
    kept?.fitPages(table.groups, pages);
    const scratch = kept ?? new Scratch(this.#device, { visible, groups: table.groups, pages }, spareBytes);
    const isSame = kept !== undefined && kept.plan === this.#boundPlan;
    if (!isSame || this.#hasOtherPairs) this.#bindRasterizer(scratch, capacity);
    this.#boundPlan = scratch.plan;
    this.#hasOtherPairs = false;
    const bindings = new FrameBindings(stages, { table, scratch });
    const monitor = this.#watch(table, capacity);
    this.#current = { table, scratch, bindings, monitor };
    return this.#current;
  }

  #bindRasterizer({ plan, splats, order, spare }: Scratch, { visible, pairs }: Capacity): void {
    this.#options.rasterizer.bind({
      plan,
      splats,
      spare,
      order: order[0],
      capacity: visible,
      pairCapacity: pairs,
    });
  }

  #watch(table: PageTable, capacity: Capacity): CapacityMonitor {
    const bounds = { least: () => this.#leastFor(table), most: this.#mostFor(table) };
    this.#current?.monitor.destroy();
    this.#counts ??= new CountBuffers(this.#device);
    return new CapacityMonitor(this.#counts, capacity, bounds, this.#memory, (requested, overflowed) => {
      this.#hasOtherPairs = requested.pairs !== this.#capacity?.pairs;
      this.#capacity = requested;
      if (overflowed) this.#options.onIncomplete();
    });
  }
}
