import type { Camera } from '@gaussian-splat/core';
import type { ProbeAnswer, ProbePoint, WorkTime } from '@gaussian-splat/renderer/tools';
import {
  distanceView,
  isSameImage,
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
import type { Content } from '../sources/content.js';
import { DepthSorter, type SortedSplats } from './depth-sorter.js';
import type { GlLoaded } from './gl-loaded.js';
import { cannotShow } from './gl-session.js';

/**
 * Maximum age of an order that is drawn, milliseconds. An older order is sorted again on the main thread, if that takes
 * at most the second value.
 */
const [OLDEST_MS, LONGEST_SORT_MS] = [80, 30];
/** Blended pixels of the first part of a first frame: a few tens of milliseconds without a GPU. */
const FIRST_PIXELS = 2 ** 20;
/** Shortest and longest duration of a part, milliseconds. Parts outside of this range make the next ones larger or smaller. */
const [SHORT_PART_MS, LONG_PART_MS] = [15, 60];
/** Cost of a splat without its pixels, in blended pixels. */
const PIXELS_OF_QUAD = 64;
/** Fraction of a full frame's time that is certainly proportional to the number of pixels. */
const SURE_SHARE = 0.5;

type Beneath = (camera: Camera) => void;

/** Canvas of an element, which gets copies of the images that the page's context draws. */
interface CopySurface extends Surface {
  readonly context: CanvasRenderingContext2D;
}

/** Draws one scene file with WebGL, or as much of a streamed scene as fits into memory. A worker sorts its splats. */
export class WebGlBackend implements Backend {
  static readonly can = (content: Content): boolean => ['file', 'stream', 'splats'].includes(content);
  readonly can = WebGlBackend.can;
  readonly filter = undefined;
  readonly isPrepared = true;
  readonly scene: GlLoaded;
  readonly place: DeviceOwner;
  /** Functions that draw the sky and the shadow, in this order, into the context's canvas beneath the splats. */
  readonly beneath: { sky?: Beneath | undefined; shadow?: Beneath | undefined } = {};
  #sorter: DepthSorter;
  /** Content of the scene that the sorter sorts. */
  #content: GlLoaded['content'];
  readonly #events: BackendEvents;
  #resolveOrdered: () => void = () => undefined;
  readonly #overdraw = new OverdrawLimit();
  /** View that the order on the GPU was sorted for; undefined before the first order. */
  #sorted: OrderView | undefined;
  /** Time at which the order on the GPU was requested, by `performance.now`. */
  #sortedAt = 0;
  /** Number of splats in the order on the GPU, and how many of them cover a pixel of the frame on average. */
  #listed = 0;
  #covered = 0;
  /** Number of frames and parts that were painted. */
  #painted = 0;
  /** View of the last request for an order. */
  #asked: OrderView | undefined;
  /** Fulfills when the first order has arrived. */
  readonly #ordered: Promise<void>;
  /** Whether a frame was requested before the first order arrived. */
  #isOwed = false;
  /** Fulfills when the first frame is drawn. */
  readonly #shown: Promise<void>;
  #resolveShown: () => void = () => undefined;
  #isShown = false;
  /** Measured time of a full frame, milliseconds; 0 while unknown. */
  #wholeMs = 0;
  #rendering: Rendering = { quality: 'default', shDegree: 3, order: 'center' };
  #isDestroyed = false;

  constructor(scene: GlLoaded, events: BackendEvents) {
    this.scene = scene;
    this.place = scene.place;
    this.#events = events;
    this.#content = scene.content;
    this.#ordered = new Promise((resolve) => (this.#resolveOrdered = resolve));
    this.#shown = new Promise((resolve) => (this.#resolveShown = resolve));
    void this.#shown.then(() => (this.#isShown = true));
    this.#sorter = this.#newSorter();
  }

  #newSorter(): DepthSorter {
    const { content, spawn } = this.scene;
    const { positions, areas } = content;
    return new DepthSorter({
      ...{ positions, areas, spawn },
      onOrder: (sorted) => {
        if (content !== this.#content) return;
        // The first order is drawn by the caller that waits for it.
        const isDue = this.#isOwed || this.#sorted !== undefined;
        this.#isOwed = false;
        this.#setOrder(sorted);
        this.#resolveOrdered();
        if (isDue) this.#events.onIncomplete();
      },
    });
  }

  /** Sorts the splats that have replaced those of the last frame. That frame stays until their first order. */
  #followScene(): void {
    if (this.#content === this.scene.content) return;
    this.#content = this.scene.content;
    const before = this.#sorter;
    this.#sorter = this.#newSorter();
    before.destroy();
    this.#sorted = this.#asked = undefined;
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
    if (this.place.isLost) return;
    this.#followScene();
    const view = this.#viewOf(frame);
    if (this.#sorted === undefined || !isSameImage(view, this.#sorted)) {
      // A script that reads the image in the same task cannot wait for the worker.
      if (frame.isRead || this.#isOld) {
        this.#asked = view;
        this.#setOrder(this.#sorter.sortNow(view));
      } else this.#ask(view);
    }
    // A scene that was loaded while the element had no size has no first frame and no order yet.
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

  /** Draws the first frame when its order has arrived, and waits until the GPU has drawn it. */
  async renderFirst(frame: CanvasFrame): Promise<void> {
    this.#ask(this.#viewOf(frame));
    // A backend that is destroyed meanwhile gets no order, and the next scene waits for the end of this frame.
    await Promise.race([this.#ordered, this.#shown, this.place.lost]);
    if (this.place.isLost || this.#isDestroyed) return;
    const begin = performance.now();
    await this.#paintInParts(frame);
    this.#wholeMs = performance.now() - begin;
    if (!this.place.isLost && !this.#isDestroyed) this.#show(frame);
  }

  /**
   * Paints a frame, and waits until the GPU has drawn it. A costly frame is painted in parts, so that other scenes can
   * be drawn in between.
   */
  async #paintInParts(frame: CanvasFrame): Promise<void> {
    const { width, height } = frame.camera;
    const pixels = this.#covered * width * height * this.pixelShare ** 2;
    let atMost = FIRST_PIXELS / (PIXELS_OF_QUAD + pixels / Math.max(1, this.#listed));
    let from = 0;
    do {
      const begin = performance.now();
      from = this.#paint(frame, from, Math.ceil(atMost));
      const painted = this.#painted;
      await whenDrawn(this.scene.lease.gl).catch(() => undefined);
      // A frame that was drawn meanwhile is newer.
      if (this.place.isLost || this.#isDestroyed || painted !== this.#painted) return;
      const ms = performance.now() - begin;
      if (ms < SHORT_PART_MS) atMost *= 4;
      else if (ms > LONG_PART_MS) atMost /= 2;
    } while (from < this.#listed);
  }

  async probe(points: readonly ProbePoint[]): Promise<ProbeAnswer[]> {
    // Each race stays in the memory of its promises, and labels ask ten times a second.
    if (!this.#isShown) await Promise.race([this.#shown, this.place.lost]);
    if (this.place.isLost || this.#isDestroyed) return [];
    // A context that is lost meanwhile has no frame either.
    return this.scene.frames.probe(points).catch((error: unknown) => {
      if (this.scene.lease.gl.isContextLost()) return [];
      throw error;
    });
  }

  async readCounts(): Promise<ReadCounts> {
    return { drawn: await this.scene.frames.countDrawn(), left: 0, contributing: null };
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
    if (this.#asked && isSameImage(view, this.#asked)) return;
    this.#asked = view;
    this.#sorter.request(view);
  }

  #setOrder({ view, order, count, covered, askedAt }: SortedSplats): void {
    // A newer order was sorted on the main thread meanwhile.
    if (this.place.isLost || this.#isDestroyed || askedAt < this.#sortedAt) return;
    this.#sorted = view;
    this.#sortedAt = askedAt;
    this.#listed = count;
    this.#covered = covered;
    this.#overdraw.note(covered, this.scene.gaussians.count);
    this.scene.frames.setOrder(order, count);
  }

  #draw(frame: CanvasFrame): void {
    this.#paint(frame);
    this.#show(frame);
  }

  #paint({ camera, settings }: CanvasFrame, from = 0, atMost = Infinity): number {
    const { quality, shDegree, filter } = this.#rendering;
    this.#painted++;
    return this.scene.frames.render({
      ...{ camera, shDegree, filter, from, atMost },
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
    // WebGL counts rows from the bottom, so an image smaller than the canvas is in its lower left corner.
    context.globalCompositeOperation = 'copy';
    context.drawImage(canvas, 0, canvas.height - height, width, height, 0, 0, width, height);
    this.#resolveShown();
  }
}
