import { GaussianSplatError, type Camera } from '@gaussian-splat/core';
import type { FrameLevers, WorkTime } from '@gaussian-splat/renderer';
import type { Attributes } from '../attributes.js';
import type { CameraChangeSource } from '../events.js';
import type { LoadedGaussians } from '../gpu/loaded-gaussians.js';
import type { FrameClient, FrameScheduler } from '../gpu/frame-scheduler.js';
import { Viewport, type Contents, type Place } from '../gpu/viewport.js';
import type { Frame } from '../live/frame-filter.js';
import { LADDER } from '../pace/ladder.js';
import type { CameraController } from './camera-controller.js';
import { PaceController } from './pace-controller.js';
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
  notePace(isWhole: boolean): void;
  /** Drawing has failed for good. */
  drawingFailed(error: unknown): void;
}

interface Settle {
  readonly resolve: () => void;
  readonly reject: (reason: unknown) => void;
}

/** All that pictures in motion may be drawn with. */
const MOVING_LEVERS: readonly Partial<FrameLevers>[] = LADDER.flatMap(({ levers }) => levers ?? []);

/** A scene that is replaced sooner, as a preview may be, needs nothing made for it, ms. */
const PREPARE_AFTER_MS = 300;

/** Draws the scene into the element's canvas, a frame at a time and only when asked. */
export class ViewController implements FrameClient {
  /** What frames in motion are drawn with. */
  readonly pace: PaceController;
  readonly #host: ViewHost;
  #viewport: Viewport | null = null;
  #context: GPUCanvasContext | null = null;
  #configured: GPUDevice | null = null;
  /** Waits for the first frame of a new scene, which is drawn also where the element is out of sight. */
  #first: Settle | undefined;
  #drawnContent = '';
  #preparing: ReturnType<typeof setTimeout> | undefined;

  constructor(host: ViewHost) {
    this.#host = host;
    this.pace = new PaceController({
      isOn: () => host.attributes.quality === 'auto',
      scheduler: () => host.scheduler,
      frameBudget: () => host.attributes.frameBudget,
      requestFrame: () => this.requestFrame(),
      onPace: (isWhole) => host.notePace(isWhole),
    });
  }

  /** Asks for a frame, if one would be seen. Free to call often. */
  requestFrame(): void {
    if (this.#isDrawable) this.#host.scheduler.request(this);
  }

  /** What frames are drawn with; null while nothing is. */
  get viewport(): Viewport | null {
    return this.#viewport;
  }

  /**
   * Draws what is to be shown from now on, or what has been added to it. Fulfils once the first frame of it is drawn, or at once where there is no pixel to draw;
   * rejects with GaussianSplatError `out-of-memory/*`.
   */
  show(place: Place): Promise<void> {
    if (place.device !== this.#viewport?.device) {
      this.#viewport?.destroy();
      const viewport = new Viewport(place, this.#host, {
        onIncomplete: () => this.requestFrame(),
        onError: (error) => this.#viewport === viewport && this.#host.drawingFailed(error),
      });
      this.#viewport = viewport;
    }
    this.pace.reset();
    return new Promise((resolve, reject) => {
      this.#first = { resolve, reject };
      this.requestFrame();
    });
  }

  /** Stops drawing. The last picture stays, so that the next scene can replace it without a gap. */
  pause(): void {
    this.#viewport?.destroy();
    this.#viewport = null;
    // Nobody need wait for it.
    this.#first?.resolve();
    this.#first = undefined;
    this.pace.stop();
    this.#host.scheduler.cancel(this);
  }

  /** Stops drawing and clears the canvas. */
  clear(): void {
    this.pause();
    this.#context?.unconfigure();
    this.#configured = null;
  }

  /** Puts another canvas in the place of one whose document has lost its window: that one never shows a picture again. */
  renewCanvas(): void {
    const canvas = this.#host.canvas;
    canvas?.replaceWith(canvas.cloneNode());
    this.#context = null;
    this.#configured = null;
  }

  drawFrame(now: number): void {
    const viewport = this.#viewport;
    // It may have left the viewport since it asked.
    if (viewport === null || !this.#isDrawable) return;
    const { camera } = this.#host;
    const pixels = this.#pixelsOf(viewport);
    // Without a size nothing is drawn; the observer of the size asks again when there is one.
    if (pixels === null) return this.#finishUnseen();
    this.#host.beforeFrame(now);
    const source = camera.step(now, this.#host.decayMs);
    try {
      const request = this.#frameRequest(viewport, pixels);
      this.#host.advanceScene(request.camera, now);
      this.#render(viewport, request, now, source !== null);
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
  drawNow(size?: PixelSize, background?: Frame['background']): HTMLCanvasElement | null {
    const viewport = this.#viewport;
    const canvas = this.#host.canvas;
    if (viewport === null || viewport.isLost || this.#first !== undefined || canvas === null) return null;
    const own = this.#pixelsOf(viewport);
    if (own === null) return null;
    this.#applyRendering(viewport);
    viewport.render({ ...this.#frameRequest(viewport, size ?? own), background }, this.#host.prepareFrame());
    return canvas;
  }

  /** There is a scene, and somebody sees it or waits for its first frame. A document without a window, as of a frame that was taken away, shows none. */
  get #isDrawable(): boolean {
    const { canvas, isVisible } = this.#host;
    if (this.#viewport?.isLost !== false || canvas?.ownerDocument.defaultView === null) return false;
    return this.#first !== undefined || isVisible;
  }

  /** null where there is no size. */
  #pixelsOf({ device }: Viewport): PixelSize | null {
    return this.#host.size.pixelSize(this.#host.attributes.maxPixelRatio, device.limits.maxTextureDimension2D);
  }

  #render(viewport: Viewport, request: Frame, now: number, cameraMoved: boolean): void {
    const first = this.#first;
    this.#first = undefined;
    this.#applyRendering(viewport);
    const content = this.#host.prepareFrame();
    const hasChanged = first === undefined && (cameraMoved || content !== this.#drawnContent);
    this.#drawnContent = content;
    const pixels = request.camera.width * request.camera.height;
    const goesOn = this.#host.camera.isMoving;
    const plan = this.pace.plan({ now, pixels, hasChanged, goesOn });
    const { levers } = plan;
    // Who has chosen a quality pays for no clock.
    const onTime =
      this.#host.attributes.quality === 'auto' ? (time: WorkTime) => this.pace.sample(plan, time) : undefined;
    if (first !== undefined) {
      viewport.renderFirst(request, content).then(() => this.#afterFirst(viewport, request, first), first.reject);
      return;
    }
    viewport.render({ ...request, levers }, content, onTime);
    this.#prepareSoon(viewport, request);
  }

  #afterFirst(viewport: Viewport, request: Frame, { resolve }: Settle): void {
    resolve();
    this.#prepareSoon(viewport, request);
  }

  /** Pictures in motion must not wait for pipelines: those that they may need are made soon after the first picture, and after a change of the quality to `auto`. */
  #prepareSoon(viewport: Viewport, { target: { format } }: Frame): void {
    if (viewport.isPrepared || this.#host.attributes.quality !== 'auto') return;
    this.#preparing ??= setTimeout(() => {
      this.#preparing = undefined;
      if (this.#viewport === viewport) viewport.prepare(MOVING_LEVERS, format);
    }, PREPARE_AFTER_MS);
  }

  #applyRendering(viewport: Viewport): void {
    const { quality, maxShDegree: shDegree, filter, order: choice } = this.#host.attributes;
    const trainedOrder = this.#host.shown.some(({ order }) => order) ? 'pixel' : 'center';
    const order = choice === 'auto' ? trainedOrder : choice;
    const trained = filter === 'auto' ? undefined : filter;
    viewport.setRendering({ quality: quality === 'auto' ? 'default' : quality, shDegree, order, filter: trained });
  }

  #finishUnseen(): void {
    if (!this.#host.size.isEmpty) return;
    this.#first?.resolve();
    this.#first = undefined;
  }

  #frameRequest(viewport: Viewport, { width, height }: PixelSize): Frame {
    const context = this.#contextFor(viewport.device);
    const canvas = context.canvas;
    // Setting a canvas's size clears it, even to the same size; here a frame follows at once.
    if (canvas.width !== width) canvas.width = width;
    if (canvas.height !== height) canvas.height = height;
    const texture = context.getCurrentTexture();
    return {
      camera: this.#host.camera.view(width, height),
      target: texture,
    };
  }

  /** The canvas's context, set up for the device. Premultiplied alpha lets the page show through. */
  #contextFor(device: GPUDevice): GPUCanvasContext {
    const context = (this.#context ??= this.#host.canvas?.getContext('webgpu') ?? null);
    if (context === null) throw noContext();
    if (this.#configured !== device) {
      const format = navigator.gpu.getPreferredCanvasFormat();
      context.configure({ device, format, usage: canvasUsage(device, format), alphaMode: 'premultiplied' });
      this.#configured = device;
    }
    return context;
  }
}

/** Compute shaders may then write the canvas itself, where the device lets them. */
function canvasUsage(device: GPUDevice, format: GPUTextureFormat): GPUTextureUsageFlags {
  const { RENDER_ATTACHMENT, STORAGE_BINDING } = GPUTextureUsage;
  const isStorable = format === 'rgba8unorm' || device.features.has('bgra8unorm-storage');
  return isStorable ? RENDER_ATTACHMENT | STORAGE_BINDING : RENDER_ATTACHMENT;
}

function noContext(): GaussianSplatError {
  return new GaussianSplatError('unsupported/no-webgpu', {
    where: 'canvas',
    expected: 'a WebGPU canvas context',
    found: 'none',
    remedy: 'use a browser that shows WebGPU on a canvas',
  });
}
