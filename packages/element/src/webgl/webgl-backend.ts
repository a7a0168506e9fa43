import type { Camera } from '@gaussian-splat/core';
import type { ProbeAnswer, ProbePoint, WorkTime } from '@gaussian-splat/renderer/tools';
import {
  distanceView,
  isSameView,
  orderView,
  OverdrawLimit,
  drawn as whenDrawn,
  type OrderView,
} from '@gaussian-splat/renderer/webgl';
import type {
  CanvasFrame,
  Backend,
  BackendEvents,
  DeviceOwner,
  ReadCounts,
  Rendering,
  Surface,
} from '../gpu/backend.js';
import { DepthSorter, type SortedSplats } from './depth-sorter.js';
import type { GlLoaded } from './gl-loaded.js';
import { cannotShow } from './gl-session.js';

/**
 * An order older than this when drawn, ms, is sorted again on the main thread if that takes no longer than the second
 * value.
 */
const [OLDEST_MS, LONGEST_SORT_MS] = [80, 30];
/** Minimum fraction of a full frame's time that is proportional to pixels. */
const SURE_SHARE = 0.5;

type Beneath = (camera: Camera) => void;

/** A canvas with copies of the images that the page's context draws. */
interface CopySurface extends Surface {
  readonly context: CanvasRenderingContext2D;
}

/** Draws one scene with WebGL, in orders that a worker finds. */
export class WebGlBackend implements Backend {
  readonly filter = undefined;
  readonly isPrepared = true;
  readonly scene: GlLoaded;
  /** Draw the sky and the shadow beneath the splats, in this order, into the context's canvas. */
  readonly beneath: { sky?: Beneath | undefined; shadow?: Beneath | undefined } = {};
  readonly #sorter: DepthSorter;
  readonly #overdraw = new OverdrawLimit();
  /** The view of the order on the GPU. */
  #sorted: OrderView | undefined;
  /** Time of the order's request, by the page's clock. */
  #sortedAt = 0;
  /** The view of the last request. */
  #asked: OrderView | undefined;
  /** Fulfills when the first order has arrived. */
  readonly #ordered: Promise<void>;
  /** A frame was asked for before there was an order to draw it in. */
  #isOwed = false;
  /** The first frame is drawn. */
  readonly #shown: Promise<void>;
  #resolveShown: () => void = () => undefined;
  /** Time of a full frame as far as known, ms. */
  #wholeMs = 0;
  #rendering: Rendering = { quality: 'default', shDegree: 3, order: 'center' };
  #isDestroyed = false;

  constructor(scene: GlLoaded, events: BackendEvents) {
    this.scene = scene;
    let resolveOrdered: () => void;
    this.#ordered = new Promise((resolve) => (resolveOrdered = resolve));
    this.#shown = new Promise((resolve) => (this.#resolveShown = resolve));
    const { positions, areas, spawn } = scene;
    this.#sorter = new DepthSorter({
      ...{ positions, areas, spawn },
      onOrder: (sorted) => {
        // A caller that waits for the first order draws it.
        const isDue = this.#isOwed || this.#sorted !== undefined;
        this.#isOwed = false;
        this.#setOrder(sorted);
        resolveOrdered();
        if (isDue) events.onIncomplete();
      },
    });
  }

  get place(): DeviceOwner {
    return this.scene.place;
  }

  get device(): GPUDevice {
    throw cannotShow('a post-processor');
  }

  async finished(): Promise<void> {}

  get pixelShare(): number {
    return this.#overdraw.share;
  }

  get byteLength(): number {
    return this.scene.frames.byteLength;
  }

  get isLost(): boolean {
    return this.scene.isLost;
  }

  get isDestroyed(): boolean {
    return this.#isDestroyed;
  }

  prepare(): void {}

  setFilter(filter: Parameters<Backend['setFilter']>[0]): void {
    if (filter === undefined) return;
    filter.close();
    throw cannotShow('a post-processor');
  }

  setRendering(rendering: Rendering): void {
    this.#rendering = rendering;
  }

  surfaceOn(canvas: HTMLCanvasElement): CopySurface | null {
    const context = canvas.getContext('2d');
    return context && { canvas, context, unconfigure: () => context.clearRect(0, 0, canvas.width, canvas.height) };
  }

  render(frame: CanvasFrame, _: string, onTime?: (time: WorkTime) => void): void {
    if (this.isLost) return;
    const view = this.#viewOf(frame);
    if (this.#sorted === undefined || !isSameView(view, this.#sorted)) {
      // Code that reads the image at once cannot wait for the worker.
      if (frame.isRead || this.#isOld) {
        this.#asked = view;
        this.#setOrder(this.#sorter.sortNow(view));
      } else this.#ask(view);
    }
    // A scene that was loaded without a size had no first frame, and has no order yet.
    if (this.#sorted === undefined) return void (this.#isOwed = true);
    if (onTime === undefined) return this.#draw(frame);
    const { resolutionScale = 1 } = frame.settings ?? {};
    const min = SURE_SHARE * this.#wholeMs * resolutionScale ** 2;
    this.scene.lease.clock
      .time(() => this.#draw(frame), min)
      .then((time) => {
        if (resolutionScale === 1) this.#wholeMs = Math.min(this.#wholeMs || Infinity, time.upperBound);
        onTime(time);
      })
      .catch(() => undefined);
  }

  /** Waits for the order of the first frame, and until the GPU has drawn it. */
  async renderFirst(frame: CanvasFrame): Promise<void> {
    this.#ask(this.#viewOf(frame));
    // A painter that is destroyed meanwhile gets no order, and the next scene waits for the end of this frame.
    await Promise.race([this.#ordered, this.#shown, this.scene.lost]);
    if (this.isLost || this.#isDestroyed) return;
    const begin = performance.now();
    this.#paint(frame);
    await whenDrawn(this.scene.lease.gl).catch(() => undefined);
    this.#wholeMs = performance.now() - begin;
    if (!this.isLost && !this.#isDestroyed) this.#show(frame);
  }

  async probe(points: readonly ProbePoint[]): Promise<ProbeAnswer[]> {
    await Promise.race([this.#shown, this.scene.lost]);
    return this.isLost || this.#isDestroyed ? [] : this.scene.frames.probe(points);
  }

  async readCounts(): Promise<ReadCounts> {
    return { drawn: this.scene.frames.countDrawn(), left: 0, contributed: null };
  }

  destroy(): void {
    if (this.#isDestroyed) return;
    this.#isDestroyed = true;
    this.#resolveShown();
    this.#sorter.destroy();
  }

  get #isOld(): boolean {
    const age = performance.now() - this.#sortedAt;
    return this.#sorted !== undefined && age > OLDEST_MS && this.#sorter.milliseconds <= LONGEST_SORT_MS;
  }

  #viewOf({ camera }: CanvasFrame): OrderView {
    const viewOf = this.#rendering.order === 'distance' ? distanceView : orderView;
    return viewOf(camera, this.scene.gaussians.origin);
  }

  #ask(view: OrderView): void {
    if (this.#asked && isSameView(view, this.#asked)) return;
    this.#asked = view;
    this.#sorter.request(view);
  }

  #setOrder({ view, order, count, covered, askedAt }: SortedSplats): void {
    // An order that was sorted synchronously meanwhile is newer.
    if (this.isLost || this.#isDestroyed || askedAt < this.#sortedAt) return;
    this.#sorted = view;
    this.#sortedAt = askedAt;
    this.#overdraw.note(covered, this.scene.gaussians.count);
    this.scene.frames.setOrder(order, count);
  }

  #draw(frame: CanvasFrame): void {
    this.#paint(frame);
    this.#show(frame);
  }

  #paint({ camera, settings }: CanvasFrame): void {
    const { quality, shDegree, filter } = this.#rendering;
    this.scene.frames.render({
      ...{ camera, shDegree, filter },
      accumulation: quality === 'balanced' || quality === 'fast' ? 'rgba16float' : 'rgba32float',
      resolutionScale: this.pixelShare * (settings?.resolutionScale ?? 1),
    });
  }

  /** Copies the painted image to the element's canvas. */
  #show({ camera, background, surface }: CanvasFrame): void {
    const { width, height } = camera;
    const { context } = surface as CopySurface;
    const { lease } = this.scene;
    lease.fit(width, height);
    const { sky, shadow } = this.beneath;
    if (sky || shadow) {
      const { gl } = lease;
      gl.bindFramebuffer(gl.FRAMEBUFFER, null);
      gl.clearBufferfv(gl.COLOR, 0, background ?? [0, 0, 0, 0]);
      sky?.(camera);
      shadow?.(camera);
      this.scene.frames.present(undefined, { keeps: true });
    } else this.scene.frames.present(background);
    const { canvas } = lease.gl;
    // WebGL counts rows from the bottom, so a smaller image lies there.
    context.globalCompositeOperation = 'copy';
    context.drawImage(canvas, 0, canvas.height - height, width, height, 0, 0, width, height);
    this.#resolveShown();
  }
}
