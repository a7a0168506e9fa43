import { GaussianSplatError, validateCamera, type Camera } from '@gaussian-splat/core';
import { pickedSurface, placeOfSurface, surfacePoints, type PickedPlace } from '../picked-surface.js';
import type { StreamProgress } from '../streaming/progress.js';
import { FrameDetail, resolutionFor } from './frame-detail.js';
import type { GlGaussians } from './gl-gaussians.js';
import type { GlHost } from './gl-host.js';
import type { GlFrameRequest, GlRenderer } from './gl-renderer.js';
import type { GlStream } from './gl-stream.js';
import type { GlHostFrame } from './host-depth.js';
import type { HostedOrder } from './hosted-order.js';
import { levelChoice } from './level-choice.js';
import { orderView, type OrderView } from './splat-order.js';

/** A scene of {@link HostedSplats}. */
interface HostedScene {
  readonly gaussians: GlGaussians;
  /** Index of its first splat. */
  readonly first: number;
  readonly hasLevels: boolean;
}

/** How a host's scene is drawn. */
export interface GlHostDrawing extends Partial<Omit<GlFrameRequest, 'camera' | 'cameras'>> {
  /** Maximum error of levels of detail, pixels; 0 draws the finest level. Default: 0, and 1 for a streamed scene. */
  readonly detail?: number;
  /**
   * Milliseconds between frames to keep while the camera moves: `detail` rises to at most four times itself while they
   * take longer, and the resolution falls to at most half of each side. Both return when frames are in time, or the
   * camera rests. Default: none.
   */
  readonly frameMs?: number;
}

/** One scene, or several in one order, in the frames of a host. */
export class HostedSplats {
  readonly #host: GlHost;
  readonly #renderer: GlRenderer;
  readonly #scenes: readonly HostedScene[];
  readonly #order: HostedOrder;
  readonly #stream: GlStream | undefined;
  #cameras: readonly Camera[] | undefined;
  /** Matrices of these cameras, copied, because a host may reuse its arrays. */
  #poses: readonly Float64Array[] = [];
  readonly #frameDetail = new FrameDetail();
  /** Error in pixels that the time of frames allows; 0 if it is the wanted one. */
  #budgetError = 0;

  /** @internal */
  constructor(
    host: GlHost,
    renderer: GlRenderer,
    scenes: readonly HostedScene[],
    { order, stream }: { order: HostedOrder; stream?: GlStream },
  ) {
    this.#stream = stream;
    this.#host = host;
    this.#renderer = renderer;
    this.#scenes = scenes;
    this.#order = order;
  }

  /** Resident pages of a streamed scene, and what limits them; undefined for other scenes. */
  get progress(): StreamProgress | undefined {
    return this.#stream && { ...this.#stream.progress, budgetError: this.#budgetError };
  }

  /**
   * Draws the scene over the host's frame.
   * @param given Camera of the host: see `cameraFromProjection`, with `clipDepth: '-1..1'`. Its view includes the
   * position of the scene. Several scenes have a camera each, all with the same projection.
   * @returns False if splats have the order of an older view, or a larger error than asked: draw again soon.
   * @throws GaussianSplatError `argument/camera` for a camera out of range; `argument/value` for a framebuffer whose
   * depth cannot be copied; `out-of-memory/allocation` if the device has too little memory.
   */
  draw(given: Camera | readonly Camera[], frame?: GlHostFrame, drawing: GlHostDrawing = {}): boolean {
    const { detail: wanted = this.#stream ? 1 : 0, frameMs = Infinity, ...how } = drawing;
    const cameras = [given].flat();
    if (cameras.length !== this.#scenes.length) throw wrongCameras(this.#scenes.length, cameras.length);
    for (const camera of cameras) validateCamera(camera);
    const isMoving = cameras.some(({ worldToCamera }, k) => !isSamePose(worldToCamera, this.#poses[k]));
    if (isMoving) this.#poses = cameras.map(({ worldToCamera }) => Float64Array.from(worldToCamera));
    const factor = frameMs < Infinity ? this.#frameDetail.next(performance.now(), frameMs, isMoving) : 1;
    const detail = factor * wanted;
    this.#budgetError = factor > 1 ? detail : 0;
    const camera = cameras[0];
    const request = { camera, cameras, accumulation: 'rgba16float', shDegree: 3, ...how } as const;
    const resolutionScale = (how.resolutionScale ?? 1) * resolutionFor(factor);
    let isSorted = false;
    this.#host.draw(this.#renderer, { ...request, resolutionScale }, frame, () => {
      isSorted = this.#sort(cameras, detail);
    });
    this.#cameras = cameras;
    return isSorted && factor === 1;
  }

  /**
   * Returns the visible surface at a point of the last frame, in the space of its scene, and the number of that scene.
   * The host's own objects hide nothing. The thread does not wait for the GPU.
   * @param x Pixels from the left edge of the camera's image.
   * @param y Pixels from its top edge.
   * @returns null outside the scene, on parts less than half opaque, and before the first frame. Rejects if the context
   * is lost.
   */
  async pick(x: number, y: number): Promise<(PickedPlace & { readonly scene: number }) | null> {
    const cameras = this.#cameras;
    if (!cameras) return null;
    const points = surfacePoints(cameras[0], x, y);
    const answers = await this.#host.run(() => this.#renderer.probe(points));
    const scene = answers[0]?.splat?.scene ?? 0;
    const surface = pickedSurface(cameras[scene], points, answers);
    return surface && { ...placeOfSurface(cameras[scene], x, y, surface), scene };
  }

  destroy(): void {
    this.#order.destroy();
    this.#renderer.destroy();
    this.#stream?.destroy();
    for (const { gaussians } of this.#stream ? [] : this.#scenes) gaussians.destroy();
  }

  #sort(cameras: readonly Camera[], detail: number): boolean {
    this.#stream?.follow(cameras[0], detail);
    const views = this.#scenes.map(({ gaussians: { facts }, first, hasLevels }, k): OrderView => {
      const levels = hasLevels ? levelChoice(cameras[k], facts.origin, detail) : undefined;
      return { ...orderView(cameras[k], facts.origin), first, levels };
    });
    return this.#order.update(views, (order, count) => {
      if (this.#stream?.write()) this.#renderer.splatsChanged();
      this.#renderer.setOrder(order, count);
    });
  }
}

const isSamePose = (a: ArrayLike<number>, b: ArrayLike<number> | undefined): boolean =>
  b !== undefined && Array.from(a).every((value, k) => value === b[k]);

const wrongCameras = (expected: number, found: number): GaussianSplatError =>
  new GaussianSplatError('argument/value', {
    where: 'HostedSplats.draw()',
    expected: `a camera for each of ${expected} scenes`,
    found: String(found),
    remedy: 'pass the cameras as an array, in the order of load()',
  });
