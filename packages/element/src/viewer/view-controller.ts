import { Lazy, type Camera } from '@gaussian-splat/core';
import type { Attributes } from './attributes.js';
import type { CameraChangeSource } from './events.js';
import type { LoadedGaussians } from '../gpu/loaded-gaussians.js';
import { targetMsOf, type FrameClient, type FrameScheduler } from '../gpu/frame-scheduler.js';
import type { CanvasFrame, FrameSource, Drawable, Backend, DeviceOwner, Surface } from '../gpu/backend.js';
import { why } from '../gpu/request-device.js';
import type { CameraController } from './camera-controller.js';
import type * as dynamicQuality from '../dynamic-quality/dynamic-quality-controller.js';
import type { PixelSize, SizeController } from './size-controller.js';

/** Interface of the element for drawing its frames. */
export interface ViewHost extends FrameSource {
  readonly attributes: Pick<
    Attributes,
    'quality' | 'maxShDegree' | 'order' | 'filter' | 'maxPixelRatio' | 'frameBudget'
  >;
  readonly sources: FrameSource['sources'] & {
    /** The loaded scenes that are drawn. */
    readonly shown: readonly LoadedGaussians[];
    /** Called once in each frame before drawing, with the frame's camera, so that animated scenes advance. */
    advance(camera: Camera, now: number): void;
    /** Called for each timed frame of a motion. `isWhole`: whether frames in motion are drawn at full quality. */
    reportMotionFrame(isWhole: boolean): void;
    /** Called when drawing has failed permanently. */
    fail(error: unknown): void;
  };
  /** Called in each frame before the camera steps, for automatic motions. `now`: requestAnimationFrame's clock, ms. */
  advance(now: number): void;
  readonly camera: CameraController;
  readonly size: SizeController;
  readonly scheduler: FrameScheduler;
  readonly canvas: HTMLCanvasElement | null;
  /** Whether a frame would be visible. */
  readonly isVisible: boolean;
  /** Time constant of the camera's damped motion, ms; 0 if the camera jumps to its goal. */
  readonly decayMs: number;
  /** Called once in each frame after its commands were submitted, with the frame's camera. */
  afterFrame(camera: Camera): void;
  cameraChanged(source: CameraChangeSource): void;
}

interface MotionEnd {
  readonly resolve: () => void;
  readonly reject: (reason: unknown) => void;
}

/**
 * Module that adapts the quality of frames in motion; it is loaded once for all elements. Until it is loaded, all
 * frames are drawn at full quality.
 */
const quality = new Lazy(
  'the code that sets the quality while moving',
  () => import('../dynamic-quality/dynamic-quality-controller.js'),
);

/**
 * Delay between a frame and the preparation of pipelines, ms. A scene that is replaced sooner, such as a preview, needs
 * no preparation.
 */
const PREPARE_AFTER_MS = 300;

/** Draws the scene to the element's canvas, frame by frame and only on request. */
export class ViewController implements FrameClient {
  readonly #host: ViewHost;
  #ownDynamicQuality: dynamicQuality.DynamicQualityController | undefined;
  #backend: Backend | null = null;
  /** The surface of the canvas; null before the first frame. */
  #surface: Surface | null = null;
  #surfaceOf: DeviceOwner['context'] | null = null;
  /** The pending promise of {@link show}. Its first frame is drawn even off-screen. */
  #first: MotionEnd | undefined;
  #drawnContent = '';
  #preparing: ReturnType<typeof setTimeout> | undefined;

  constructor(host: ViewHost) {
    this.#host = host;
  }

  /** Quality control of frames in motion; undefined until its module is loaded. */
  get #dynamicQuality(): dynamicQuality.DynamicQualityController | undefined {
    const host = this.#host;
    return (this.#ownDynamicQuality ??=
      quality.value &&
      new quality.value.DynamicQualityController({
        isOn: () => this.#isAuto,
        scheduler: () => host.scheduler,
        frameBudget: () => host.attributes.frameBudget,
        requestFrame: () => this.requestFrame(),
        mayFade: () => !this.#backend?.filter,
        onFrameTimed: (isWhole) => host.sources.reportMotionFrame(isWhole),
        scenes: () => host.sources.shown,
      }));
  }

  get #isAuto(): boolean {
    return this.#host.attributes.quality === 'auto';
  }

  /** Quality of the last frame and of frames in motion, for statistics. */
  get dynamicQuality(): dynamicQuality.DynamicQualityReport {
    const { attributes, scheduler } = this.#host;
    const targetMs = targetMsOf(attributes.frameBudget, scheduler);
    const atStart = {
      drawn: 'whole',
      moving: 'whole',
      reason: 'initial',
      frameMs: null,
      lastMs: null,
      targetMs,
    } as const;
    return this.#dynamicQuality?.report ?? atStart;
  }

  /**
   * Requests a frame if it would be visible, or if the first frame of a scene is pending. May be called at any rate.
   */
  requestFrame(): void {
    if (this.#isDrawable) this.#host.scheduler.request(this);
  }

  /** The backend that draws frames; null while no scene is shown. */
  get backend(): Backend | null {
    return this.#backend;
  }

  /**
   * Draws a new scene, or additions to the current one. Resolves when its first frame is drawn, or at once if there is
   * no pixel to draw. Rejects with GaussianSplatError `out-of-memory/*`.
   */
  show(scene: Drawable): Promise<void> {
    if (scene.place.context !== this.#backend?.place.context) {
      this.#backend?.destroy();
      const backend = scene.openBackend(this.#host, {
        onIncomplete: () => this.requestFrame(),
        onError: (error) => this.#backend === backend && this.#host.sources.fail(error),
      });
      this.#backend = backend;
    }
    this.#dynamicQuality?.reset();
    return new Promise((resolve, reject) => {
      this.#first = { resolve, reject };
      this.requestFrame();
    });
  }

  /** Stops drawing. The last frame stays visible, so that the next scene can replace it without a gap. */
  pause(): void {
    this.#backend?.destroy();
    this.#backend = null;
    // The wait for a first frame ends.
    this.#first?.resolve();
    this.#first = undefined;
    this.#dynamicQuality?.stop();
    this.#host.scheduler.cancel(this);
  }

  /** Stops drawing and clears the canvas. */
  clear(): void {
    this.pause();
    this.#surface?.unconfigure();
    this.#surfaceOf = null;
  }

  /**
   * Replaces the canvas with a copy. Call if the canvas cannot show frames any more: its document has lost its window,
   * or the next context is of another kind.
   */
  renewCanvas(): void {
    const canvas = this.#host.canvas;
    canvas?.replaceWith(canvas.cloneNode());
    this.#host.size.hostUpdated();
    this.#surface = null;
    this.#surfaceOf = null;
  }

  drawFrame(now: number): void {
    const backend = this.#backend;
    // The element may have left the viewport since the request.
    if (backend === null || !this.#isDrawable) return;
    const { camera } = this.#host;
    const pixels = this.#pixelsOf(backend);
    // A canvas without a size is not drawn. The size observer requests a frame when the canvas has a size.
    if (pixels === null) return this.#finishUnseen();
    this.#host.advance(now);
    const source = camera.step(now, this.#host.decayMs);
    const fail = (error: unknown): void => this.#host.sources.fail(error);
    try {
      const request = this.#frameRequest(backend, pixels);
      if (request === null) return void why(({ noContext }) => noContext()).then(fail, fail);
      this.#host.sources.advance(request.camera, now);
      this.#render(backend, request, now, source !== null);
      this.#host.afterFrame(request.camera);
    } catch (error) {
      return fail(error);
    }
    if (camera.isMoving) this.requestFrame();
    if (source !== null) this.#host.cameraChanged(source);
  }

  /**
   * Draws a frame within the current task, for code that reads the canvas before the task ends. Afterwards a WebGPU
   * canvas reads as blank.
   * @param size Size of the frame in pixels; default: that of the element.
   * @param background Premultiplied color behind the splats.
   * @returns The canvas, or null if there is nothing to draw.
   */
  drawNow(size?: PixelSize, background?: CanvasFrame['background']): HTMLCanvasElement | null {
    const backend = this.#backend;
    const canvas = this.#host.canvas;
    if (backend === null || backend.place.isLost || this.#first !== undefined || canvas === null) return null;
    const own = this.#pixelsOf(backend);
    if (own === null) return null;
    this.applyRendering(backend);
    const request = this.#frameRequest(backend, size ?? own);
    if (request === null) return null;
    backend.render({ ...request, background, isRead: true }, this.#host.prepareFrame());
    return request.surface.canvas as HTMLCanvasElement;
  }

  /**
   * Whether a frame can be drawn and is needed: the scene is visible, or its first frame is pending. A document without
   * a window, such as that of a removed `<iframe>`, shows no frames.
   */
  get #isDrawable(): boolean {
    const { canvas, isVisible } = this.#host;
    if (this.#backend?.place.isLost !== false || canvas?.ownerDocument.defaultView === null) return false;
    return this.#first !== undefined || isVisible;
  }

  /** Returns the size of the next frame in pixels; null if the canvas has no pixels or an unknown size. */
  #pixelsOf({ place }: Backend): PixelSize | null {
    const { size, attributes } = this.#host;
    return size.pixelSize(attributes.maxPixelRatio, place.limits.maxTextureDimension2D);
  }

  #render(backend: Backend, request: CanvasFrame, now: number, cameraMoved: boolean): void {
    const first = this.#first;
    this.#first = undefined;
    this.applyRendering(backend);
    const content = this.#host.prepareFrame();
    const hasChanged = first === undefined && (cameraMoved || content !== this.#drawnContent);
    this.#drawnContent = content;
    if (first !== undefined) {
      backend.renderFirst(request, content).then(() => {
        first.resolve();
        this.#prepareSoon();
      }, first.reject);
      return;
    }
    const pixels = request.camera.width * request.camera.height;
    const occasion = { now, pixels, hasChanged, goesOn: this.#host.camera.isMoving };
    const draw: dynamicQuality.DrawFrame = (settings, onTime) =>
      backend.render({ ...request, settings }, content, onTime);
    if (this.#dynamicQuality) this.#dynamicQuality.draw(occasion, this.#host.canvas!, draw);
    else draw(undefined);
    this.#prepareSoon();
  }

  /**
   * Compiles the pipelines of frames in motion soon after the first frame, and after the quality changes to `auto`.
   * Frames in motion therefore do not wait for pipelines.
   */
  #prepareSoon(): void {
    if (!this.#isAuto) return;
    quality.want();
    if (this.#backend?.isPrepared) return;
    this.#preparing ??= setTimeout(() => {
      void quality.settled.then(() => {
        this.#preparing = undefined;
        // Another scene may have replaced the one of the first frame.
        if (quality.value) this.#backend?.prepare(quality.value.MOVING_SETTINGS);
      });
    }, PREPARE_AFTER_MS);
  }

  /** Applies the settings of the page to a backend, for its next frames. */
  applyRendering(backend: Backend): void {
    const { quality, maxShDegree: shDegree, filter, order: choice } = this.#host.attributes;
    const trained = this.#host.sources.shown.find((one) => one.order)?.order ?? 'center';
    const order = choice === 'auto' ? trained : choice;
    const declared = filter === 'auto' ? undefined : filter;
    backend.setRendering({ quality: quality === 'auto' ? 'default' : quality, shDegree, order, filter: declared });
  }

  #finishUnseen(): void {
    if (!this.#host.size.isEmpty) return;
    this.#first?.resolve();
    this.#first = undefined;
  }

  #frameRequest(backend: Backend, { width, height }: PixelSize): CanvasFrame | null {
    const surface = this.#surfaceFor(backend);
    if (surface === null) return null;
    const { canvas } = surface;
    // Setting the size of a canvas clears it, even to the same size. Here the next frame follows in the same task.
    if (canvas.width !== width) canvas.width = width;
    if (canvas.height !== height) canvas.height = height;
    return { camera: this.#host.camera.view(width, height), surface };
  }

  /**
   * Returns the surface of the canvas for a backend. A canvas with another kind of context is replaced. Null if the
   * browser does not support the backend's context.
   */
  #surfaceFor(backend: Backend): Surface | null {
    const take = (): Surface | null => (this.#surface = backend.surfaceOn(this.#host.canvas!));
    if (this.#surfaceOf !== backend.place.context && take() === null) {
      // A canvas supports only the kind of context that it had first, so another kind needs a new canvas.
      this.renewCanvas();
      take();
    }
    this.#surfaceOf = backend.place.context;
    return this.#surface;
  }
}
