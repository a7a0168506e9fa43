import { Lazy, type Camera } from '@gaussian-splat/core';
import type { Attributes } from '../attributes.js';
import type { CameraChangeSource } from '../events.js';
import type { LoadedGaussians } from '../gpu/loaded-gaussians.js';
import { targetMsOf, type FrameClient, type FrameScheduler } from '../gpu/frame-scheduler.js';
import type { CanvasFrame, Contents, Drawable, Painter, Place, Surface } from '../gpu/painter.js';
import { why } from '../gpu/request-device.js';
import type { CameraController } from './camera-controller.js';
import type * as dynamicQuality from './dynamic-quality-controller.js';
import type { PixelSize, SizeController } from './size-controller.js';

/** What the view needs to know of its element. */
export interface ViewHost extends Contents {
  readonly attributes: Pick<
    Attributes,
    'quality' | 'maxShDegree' | 'order' | 'filter' | 'maxPixelRatio' | 'frameBudget'
  >;
  /** The sources that are drawn. */
  readonly shown: readonly LoadedGaussians[];
  readonly camera: CameraController;
  readonly size: SizeController;
  readonly scheduler: FrameScheduler;
  readonly canvas: HTMLCanvasElement | null;
  /** False where nobody would see a frame. */
  readonly isVisible: boolean;
  /** Time constant of the camera's motion, ms. */
  readonly decayMs: number;
  /** Called once a frame before the camera steps: what moves it by itself does so now. */
  beforeFrame(now: number): void;
  /** Called once a frame, before it is drawn, with the camera that it is drawn from: a scene that moves goes on. */
  advanceScene(camera: Camera, now: number): void;
  /** Called once a frame, after it was submitted, with the camera that it is drawn from. */
  afterFrame(camera: Camera): void;
  cameraChanged(source: CameraChangeSource): void;
  /** Called for each frame of a motion that was timed: whether such are drawn whole. */
  reportMotionFrame(isWhole: boolean): void;
  /** Drawing has failed for good. */
  drawingFailed(error: unknown): void;
}

interface Settle {
  readonly resolve: () => void;
  readonly reject: (reason: unknown) => void;
}

/** Sets the quality while moving; fetched once for all elements. Without it all frames are whole, and none waits for it. */
const quality = new Lazy(
  'the code that sets the quality while moving',
  () => import('./dynamic-quality-controller.js'),
);

/** A scene that is replaced sooner, as a preview may be, needs nothing made for it, ms. */
const PREPARE_AFTER_MS = 300;

/** Draws the scene into the element's canvas, a frame at a time and only when asked. */
export class ViewController implements FrameClient {
  readonly #host: ViewHost;
  #ownPace: dynamicQuality.DynamicQualityController | undefined;
  #painter: Painter | null = null;
  /** What is drawn into, and the device that it was set up for. */
  #surface: Surface | null = null;
  #surfaceOf: Place['context'] | null = null;
  /** Waits for the first frame of a new scene, which is drawn also where the element is out of sight. */
  #first: Settle | undefined;
  #drawnContent = '';
  #preparing: ReturnType<typeof setTimeout> | undefined;

  constructor(host: ViewHost) {
    this.#host = host;
  }

  /** What frames in motion are drawn with; undefined until its code is there. */
  get #pace(): dynamicQuality.DynamicQualityController | undefined {
    const host = this.#host;
    return (this.#ownPace ??=
      quality.value &&
      new quality.value.DynamicQualityController({
        isOn: () => this.#isAuto,
        scheduler: () => host.scheduler,
        frameBudget: () => host.attributes.frameBudget,
        requestFrame: () => this.requestFrame(),
        mayFade: () => !this.#painter?.filter,
        onFrameTimed: (isWhole) => host.reportMotionFrame(isWhole),
      }));
  }

  get #isAuto(): boolean {
    return this.#host.attributes.quality === 'auto';
  }

  /** What frames at rest and in motion are drawn with. */
  get dynamicQuality(): dynamicQuality.DynamicQualityReport {
    const { attributes, scheduler } = this.#host;
    const targetMs = targetMsOf(attributes.frameBudget, scheduler);
    const atStart = {
      drawn: 'whole',
      moving: 'whole',
      reason: 'start',
      frameMs: null,
      lastMs: null,
      targetMs,
    } as const;
    return this.#pace?.report ?? atStart;
  }

  /** Asks for a frame, if one would be seen. Free to call often. */
  requestFrame(): void {
    if (this.#isDrawable) this.#host.scheduler.request(this);
  }

  /** What frames are drawn with; null while nothing is. */
  get painter(): Painter | null {
    return this.#painter;
  }

  /**
   * Draws what is to be shown from now on, or what has been added to it. Fulfils once the first frame of it is drawn, or at once where there is no pixel to draw;
   * rejects with GaussianSplatError `out-of-memory/*`.
   */
  show(scene: Drawable): Promise<void> {
    if (scene.place.context !== this.#painter?.place.context) {
      this.#painter?.destroy();
      const painter = scene.openPainter(this.#host, {
        onIncomplete: () => this.requestFrame(),
        onError: (error) => this.#painter === painter && this.#host.drawingFailed(error),
      });
      this.#painter = painter;
    }
    this.#pace?.reset();
    return new Promise((resolve, reject) => {
      this.#first = { resolve, reject };
      this.requestFrame();
    });
  }

  /** Stops drawing. The last picture stays, so that the next scene can replace it without a gap. */
  pause(): void {
    this.#painter?.destroy();
    this.#painter = null;
    // Nobody need wait for it.
    this.#first?.resolve();
    this.#first = undefined;
    this.#pace?.stop();
    this.#host.scheduler.cancel(this);
  }

  /** Stops drawing and clears the canvas. */
  clear(): void {
    this.pause();
    this.#surface?.unconfigure();
    this.#surfaceOf = null;
  }

  /** Puts another canvas in the place of one that never shows a picture again: its document has lost its window, or something else draws now. */
  renewCanvas(): void {
    const canvas = this.#host.canvas;
    canvas?.replaceWith(canvas.cloneNode());
    this.#host.size.hostUpdated();
    this.#surface = null;
    this.#surfaceOf = null;
  }

  drawFrame(now: number): void {
    const painter = this.#painter;
    // It may have left the viewport since it asked.
    if (painter === null || !this.#isDrawable) return;
    const { camera } = this.#host;
    const pixels = this.#pixelsOf(painter);
    // Without a size nothing is drawn; the observer of the size asks again when there is one.
    if (pixels === null) return this.#finishUnseen();
    this.#host.beforeFrame(now);
    const source = camera.step(now, this.#host.decayMs);
    try {
      const request = this.#frameRequest(painter, pixels);
      if (request === null)
        return void why(({ noContext }) => noContext()).then((error) => this.#host.drawingFailed(error));
      this.#host.advanceScene(request.camera, now);
      this.#render(painter, request, now, source !== null);
      this.#host.afterFrame(request.camera);
    } catch (error) {
      return this.#host.drawingFailed(error);
    }
    if (camera.isMoving) this.requestFrame();
    if (source !== null) this.#host.cameraChanged(source);
  }

  /**
   * Draws a frame within the running task, for those who read the canvas before it ends: afterwards a WebGPU canvas is blank to readers.
   * @param size of the picture; default that of the element
   * @param background premultiplied, behind the splats
   * @returns the canvas, or null where there is nothing to draw.
   */
  drawNow(size?: PixelSize, background?: CanvasFrame['background']): HTMLCanvasElement | null {
    const painter = this.#painter;
    const canvas = this.#host.canvas;
    if (painter === null || painter.isLost || this.#first !== undefined || canvas === null) return null;
    const own = this.#pixelsOf(painter);
    if (own === null) return null;
    this.#applyRendering(painter);
    const request = this.#frameRequest(painter, size ?? own);
    if (request === null) return null;
    painter.render({ ...request, background, isRead: true }, this.#host.prepareFrame());
    return request.surface.canvas as HTMLCanvasElement;
  }

  /** There is a scene, and somebody sees it or waits for its first frame. A document without a window, as of a frame that was taken away, shows none. */
  get #isDrawable(): boolean {
    const { canvas, isVisible } = this.#host;
    if (this.#painter?.isLost !== false || canvas?.ownerDocument.defaultView === null) return false;
    return this.#first !== undefined || isVisible;
  }

  /** null where there is no size. */
  #pixelsOf({ place }: Painter): PixelSize | null {
    const { size, attributes } = this.#host;
    return size.pixelSize(attributes.maxPixelRatio, place.limits.maxTextureDimension2D);
  }

  #render(painter: Painter, request: CanvasFrame, now: number, cameraMoved: boolean): void {
    const first = this.#first;
    this.#first = undefined;
    this.#applyRendering(painter);
    const content = this.#host.prepareFrame();
    const hasChanged = first === undefined && (cameraMoved || content !== this.#drawnContent);
    this.#drawnContent = content;
    if (first !== undefined) {
      painter.renderFirst(request, content).then(() => this.#afterFirst(painter, first), first.reject);
      return;
    }
    const pixels = request.camera.width * request.camera.height;
    const occasion = { now, pixels, hasChanged, goesOn: this.#host.camera.isMoving };
    const draw: dynamicQuality.DrawFrame = (settings, onTime) =>
      painter.render({ ...request, settings }, content, onTime);
    if (this.#pace) this.#pace.draw(occasion, this.#host.canvas!, draw);
    else draw(undefined);
    this.#prepareSoon(painter);
  }

  #afterFirst(painter: Painter, { resolve }: Settle): void {
    resolve();
    this.#prepareSoon(painter);
  }

  /** Pictures in motion must not wait for pipelines: those that they may need are made soon after the first picture, and after a change of the quality to `auto`. */
  #prepareSoon(painter: Painter): void {
    if (!this.#isAuto) return;
    quality.want();
    if (painter.isPrepared) return;
    this.#preparing ??= setTimeout(() => {
      void quality.settled.then(() => {
        this.#preparing = undefined;
        if (this.#painter === painter && quality.value) painter.prepare(quality.value.MOVING_SETTINGS);
      });
    }, PREPARE_AFTER_MS);
  }

  #applyRendering(painter: Painter): void {
    const { quality, maxShDegree: shDegree, filter, order: choice } = this.#host.attributes;
    const trainedOrder = this.#host.shown.some(({ order }) => order) ? 'pixel' : 'center';
    const order = choice === 'auto' ? trainedOrder : choice;
    const trained = filter === 'auto' ? undefined : filter;
    painter.setRendering({ quality: quality === 'auto' ? 'default' : quality, shDegree, order, filter: trained });
  }

  #finishUnseen(): void {
    if (!this.#host.size.isEmpty) return;
    this.#first?.resolve();
    this.#first = undefined;
  }

  #frameRequest(painter: Painter, { width, height }: PixelSize): CanvasFrame | null {
    const surface = this.#surfaceFor(painter);
    if (surface === null) return null;
    const { canvas } = surface;
    // Setting a canvas's size clears it, even to the same size; here a frame follows at once.
    if (canvas.width !== width) canvas.width = width;
    if (canvas.height !== height) canvas.height = height;
    return { camera: this.#host.camera.view(width, height), surface };
  }

  /** null where the browser shows nothing of the kind on a canvas. */
  #surfaceFor(painter: Painter): Surface | null {
    const take = (): Surface | null => (this.#surface = painter.surfaceOn(this.#host.canvas!));
    if (this.#surfaceOf !== painter.place.context && take() === null) {
      // What has drawn on this canvas keeps it.
      this.renewCanvas();
      take();
    }
    this.#surfaceOf = painter.place.context;
    return this.#surface;
  }
}
