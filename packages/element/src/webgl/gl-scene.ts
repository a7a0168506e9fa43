import { MemoryLedger, type ProbeAnswer, type ProbePoint, type WorkTime } from '@gaussian-splat/renderer';
import {
  glBytes,
  GlGaussians,
  GlRenderer,
  isSameView,
  orderView,
  drawn as whenDrawn,
  type GlGaussianFacts,
  type OrderView,
} from '@gaussian-splat/renderer/webgl';
import type { GaussianSplatError } from '@gaussian-splat/core';
import type { SceneBounds } from '../camera/settings.js';
import type { CanvasFrame, DetailLevers, OwnedLevels, Rendering, Surface } from '../gpu/gpu-scene.js';
import { defaultMemoryBudget } from '../gpu/memory-budget.js';
import type { Timeline } from '../live/live-model.js';
import type { LoadedScene } from '../loading/protocol.js';
import type { ReadCounts } from '../stats.js';
import { DepthSorter, type SortedSplats } from './depth-sorter.js';
import type { GlLease } from './gl-session.js';

/** An order that is older when it is drawn, ms, is made anew on the page's thread, where that is known to take no longer than the second. */
const [OLDEST_MS, LONGEST_SORT_MS] = [80, 30];
/** Of what a whole frame takes, the share that its pixels surely do. */
const SURE_SHARE = 0.5;
/** 32-bit words of a splat's geometry; the first three are its position. */
const GEOMETRY_WORDS = 8;

/** A canvas that shows copies of what the page's context draws. */
interface CopySurface extends Surface {
  readonly context: CanvasRenderingContext2D;
}

export interface GlSceneOptions {
  readonly signal: AbortSignal;
  readonly memoryBudget: number | undefined;
  readonly spawn: () => Worker;
}

/** A scene that is drawn with WebGL: what the element asks of a `GpuScene`, as far as WebGL can do it. */
export class GlScene {
  readonly renderer = 'webgl';
  readonly bounds: SceneBounds;
  readonly gaussians: GlGaussianFacts & {
    readonly version: 0;
    readonly byteLength: number;
    readonly frameCount?: undefined;
    readonly leafCount?: undefined;
  };
  readonly live: Timeline | undefined = undefined;
  readonly levels: OwnedLevels | undefined = undefined;
  readonly filter = undefined;
  readonly detail: DetailLevers = {};
  /** None are built. */
  readonly hasOwnLevels = true as const;
  readonly isPrepared = true;
  onIncomplete: () => void = () => undefined;
  onError: (error: GaussianSplatError) => void = () => undefined;
  readonly #lease: GlLease;
  readonly #textures: GlGaussians;
  readonly #frames: GlRenderer;
  readonly #sorter: DepthSorter;
  readonly #reservation: { release(): void };
  /** The view that the order on the GPU is of. */
  #sorted: OrderView | undefined;
  /** When it was asked for, by the page's clock. */
  #sortedAt = 0;
  /** The view that was asked for last. */
  #asked: OrderView | undefined;
  /** The first order is there. */
  readonly #ordered: Promise<void>;
  /** The first frame is drawn. */
  readonly #shown: Promise<void>;
  #tellShown: () => void = () => undefined;
  /** What a whole frame takes, as far as is known, ms. */
  #wholeMs = 0;
  #rendering: Rendering = { quality: 'default', shDegree: 3 };
  #destroyed = false;

  private constructor(
    lease: GlLease,
    textures: GlGaussians,
    { packed, bounds }: LoadedScene,
    reservation: { release(): void },
    spawn: () => Worker,
  ) {
    this.#lease = lease;
    this.#textures = textures;
    this.#reservation = reservation;
    this.bounds = bounds;
    this.gaussians = { ...textures.facts, version: 0, byteLength: glBytes(packed) };
    this.#frames = new GlRenderer(lease.gl, textures);
    let tellOrdered: () => void;
    this.#ordered = new Promise((resolve) => (tellOrdered = resolve));
    this.#shown = new Promise((resolve) => (this.#tellShown = resolve));
    this.#sorter = new DepthSorter({
      positions: positionsIn(packed.geometry),
      spawn,
      onOrder: (sorted) => {
        const isFirst = this.#sorted === undefined;
        this.#setOrder(sorted);
        tellOrdered();
        if (!isFirst) this.onIncomplete();
      },
    });
  }

  /** Puts a scene on the GPU, which then owns the lease. Rejects with GaussianSplatError `out-of-memory/*` or the signal's reason. */
  static async open(lease: GlLease, scene: LoadedScene, options: GlSceneOptions): Promise<GlScene> {
    const { signal, memoryBudget, spawn } = options;
    const { packed } = scene;
    const ledger = MemoryLedger.of(lease.device);
    ledger.budgetBytes = Math.max(memoryBudget ?? 0, defaultMemoryBudget() ?? Infinity);
    const reservation = ledger.reserve(`scene of ${packed.count} splats`, glBytes(packed), memoryBudget);
    let textures: GlGaussians | undefined;
    try {
      textures = await GlGaussians.upload(lease.gl, packed);
      signal.throwIfAborted();
      return new GlScene(lease, textures, scene, reservation, spawn);
    } catch (error) {
      textures?.destroy();
      reservation.release();
      throw error;
    }
  }

  /** Its limits alone. */
  get device(): GPUDevice {
    return this.#lease.device;
  }

  get frameBytes(): number {
    return this.#frames.byteLength;
  }

  get isLost(): boolean {
    return this.#lease.isLost;
  }

  get lost(): Promise<GPUDeviceLostInfo> {
    return this.#lease.lost.then(
      () => ({ reason: 'unknown', message: 'the WebGL context was lost' }) as GPUDeviceLostInfo,
    );
  }

  get isDestroyed(): boolean {
    return this.#destroyed;
  }

  async wasLost(): Promise<boolean> {
    return this.isLost;
  }

  setLevels(): void {}

  setDetail(): void {}

  setFilter(): void {}

  prepare(): void {}

  setRendering(rendering: Rendering): void {
    this.#rendering = rendering;
  }

  surfaceOn(canvas: HTMLCanvasElement): CopySurface | null {
    const context = canvas.getContext('2d');
    return context && { canvas, context, unconfigure: () => context.clearRect(0, 0, canvas.width, canvas.height) };
  }

  render(frame: CanvasFrame, onTime?: (time: WorkTime) => void): void {
    if (this.isLost) return;
    const view = orderView(frame.camera, this.gaussians.origin);
    if (this.#sorted === undefined || !isSameView(view, this.#sorted)) {
      // Who reads the picture at once cannot wait for the worker.
      if (frame.isRead || this.#isOld) {
        this.#asked = view;
        this.#setOrder(this.#sorter.sortNow(view));
      } else this.#ask(view);
    }
    // The first frame waits for an order.
    if (this.#sorted === undefined) return;
    if (onTime === undefined) return this.#draw(frame);
    const { resolutionScale = 1 } = frame.levers ?? {};
    const least = SURE_SHARE * this.#wholeMs * resolutionScale ** 2;
    this.#lease.clock
      .time(() => this.#draw(frame), least)
      .then((time) => {
        if (resolutionScale === 1) this.#wholeMs = Math.min(this.#wholeMs, time.atMost);
        onTime(time);
      })
      .catch(() => undefined);
  }

  /** Waits for the order of the first frame, and until the GPU has drawn it. */
  async renderFirst(frame: CanvasFrame): Promise<void> {
    this.#ask(orderView(frame.camera, this.gaussians.origin));
    await Promise.race([this.#ordered, this.lost]);
    if (this.isLost || this.#destroyed) return;
    const begin = performance.now();
    this.#paint(frame);
    await whenDrawn(this.#lease.gl).catch(() => undefined);
    this.#wholeMs = performance.now() - begin;
    if (!this.isLost && !this.#destroyed) this.#show(frame);
    this.#tellShown();
  }

  async probe(points: readonly ProbePoint[]): Promise<ProbeAnswer[]> {
    await Promise.race([this.#shown, this.lost]);
    return this.isLost || this.#destroyed ? [] : this.#frames.probe(points);
  }

  async readCounts(): Promise<ReadCounts> {
    return { drawn: this.#frames.countDrawn(), left: 0, contributed: null };
  }

  destroy(): void {
    if (this.#destroyed) return;
    this.#destroyed = true;
    this.#tellShown();
    this.#sorter.destroy();
    this.#frames.destroy();
    this.#textures.destroy();
    this.#reservation.release();
    this.#lease.release();
  }

  get #isOld(): boolean {
    const age = performance.now() - this.#sortedAt;
    return this.#sorted !== undefined && age > OLDEST_MS && this.#sorter.milliseconds <= LONGEST_SORT_MS;
  }

  #ask(view: OrderView): void {
    if (this.#asked && isSameView(view, this.#asked)) return;
    this.#asked = view;
    this.#sorter.request(view);
  }

  #setOrder({ view, order, count, askedAt }: SortedSplats): void {
    // What was sorted at once meanwhile is newer.
    if (this.isLost || this.#destroyed || askedAt < this.#sortedAt) return;
    this.#sorted = view;
    this.#sortedAt = askedAt;
    this.#frames.setOrder(order, count);
  }

  #draw(frame: CanvasFrame): void {
    this.#paint(frame);
    this.#show(frame);
  }

  #paint({ camera, levers }: CanvasFrame): void {
    const { quality, shDegree } = this.#rendering;
    this.#frames.render({
      camera,
      shDegree,
      accumulation: quality === 'balanced' || quality === 'fast' ? 'rgba16float' : 'rgba32float',
      resolutionScale: levers?.resolutionScale ?? 1,
    });
  }

  /** Copies what was painted to the element's canvas. */
  #show({ camera: { width, height }, surface }: CanvasFrame): void {
    const { context } = surface as CopySurface;
    this.#lease.fit(width, height);
    this.#frames.present();
    const { canvas } = this.#lease.gl;
    // WebGL counts rows from below, so that is where a smaller image lies.
    context.globalCompositeOperation = 'copy';
    context.drawImage(canvas, 0, canvas.height - height, width, height, 0, 0, width, height);
  }
}

function positionsIn(geometry: Uint32Array): Float32Array {
  const numbers = new Float32Array(geometry.buffer, geometry.byteOffset, geometry.length);
  const positions = new Float32Array((3 * geometry.length) / GEOMETRY_WORDS);
  for (let at = 0, from = 0; at < positions.length; at += 3, from += GEOMETRY_WORDS) {
    positions[at] = numbers[from];
    positions[at + 1] = numbers[from + 1];
    positions[at + 2] = numbers[from + 2];
  }
  return positions;
}
