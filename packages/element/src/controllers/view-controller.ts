import type { Camera } from '@gaussian-splat/core';
import type { FrameLevers, WorkTime } from '@gaussian-splat/renderer';
import type { Attributes } from '../attributes.js';
import type { CameraChangeSource } from '../events.js';
import type { FrameClient, FrameScheduler } from '../gpu/frame-scheduler.js';
import type { CanvasFrame, Surface } from '../gpu/gpu-scene.js';
import type { DrawnScene } from '../gpu/open-scene.js';
import { why } from '../gpu/request-device.js';
import { LADDER } from '../pace/ladder.js';
import type { CameraController } from './camera-controller.js';
import { PaceController } from './pace-controller.js';
import type { PixelSize, SizeController } from './size-controller.js';

/** What the view needs to know of its element. */
export interface ViewHost {
  readonly attributes: Pick<Attributes, 'quality' | 'maxShDegree' | 'maxPixelRatio' | 'frameBudget'>;
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
  advanceScene(scene: DrawnScene, camera: Camera, now: number): void;
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
  #scene: DrawnScene | null = null;
  /** What is drawn into, and the scene that it was set up for. */
  #surface: Surface | null = null;
  #surfaceOf: DrawnScene | null = null;
  /** Waits for the first frame of a new scene, which is drawn also where the element is out of sight. */
  #first: Settle | undefined;
  #drawnVersion = 0;
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

  /**
   * Takes a scene over. Fulfils once its first frame is drawn, or at once where there is no pixel to draw; rejects with
   * GaussianSplatError `out-of-memory/*`.
   */
  show(scene: DrawnScene): Promise<void> {
    this.#scene = scene;
    scene.onIncomplete = () => this.requestFrame();
    scene.onError = (error) => this.#scene === scene && this.#host.drawingFailed(error);
    this.pace.reset();
    return new Promise((resolve, reject) => {
      this.#first = { resolve, reject };
      this.requestFrame();
    });
  }

  /** Stops drawing. The last picture stays, so that the next scene can replace it without a gap. */
  pause(): void {
    this.#scene = null;
    this.#first = undefined;
    this.pace.stop();
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
    const scene = this.#scene;
    // It may have left the viewport since it asked.
    if (scene === null || !this.#isDrawable) return;
    const { camera } = this.#host;
    const pixels = this.#pixelsOf(scene);
    // Without a size nothing is drawn; the observer of the size asks again when there is one.
    if (pixels === null) return this.#finishUnseen();
    this.#host.beforeFrame(now);
    const source = camera.step(now, this.#host.decayMs);
    try {
      const request = this.#frameRequest(scene, pixels);
      if (request === null)
        return void why(({ noContext }) => noContext()).then((error) => this.#host.drawingFailed(error));
      this.#host.advanceScene(scene, request.camera, now);
      this.#render(scene, request, now, source !== null);
      this.#host.afterFrame(request.camera);
    } catch (error) {
      return this.#host.drawingFailed(error);
    }
    if (camera.isMoving) this.requestFrame();
    if (source !== null) this.#host.cameraChanged(source);
  }

  /**
   * Draws a frame within the running task, for those who read the canvas before it ends: afterwards a WebGPU canvas is blank to readers.
   * @returns the canvas, or null where there is nothing to draw.
   */
  drawNow(): HTMLCanvasElement | null {
    const scene = this.#scene;
    const canvas = this.#host.canvas;
    if (scene === null || scene.isLost || this.#first !== undefined || canvas === null) return null;
    const pixels = this.#pixelsOf(scene);
    if (pixels === null) return null;
    this.#applyRendering(scene);
    const request = this.#frameRequest(scene, pixels);
    if (request === null) return null;
    scene.render({ ...request, isRead: true });
    return request.surface.canvas as HTMLCanvasElement;
  }

  /** There is a scene, and somebody sees it or waits for its first frame. A document without a window, as of a frame that was taken away, shows none. */
  get #isDrawable(): boolean {
    const { canvas, isVisible } = this.#host;
    if (this.#scene?.isLost !== false || canvas?.ownerDocument.defaultView === null) return false;
    return this.#first !== undefined || isVisible;
  }

  /** null where there is no size. */
  #pixelsOf({ device }: DrawnScene): PixelSize | null {
    return this.#host.size.pixelSize(this.#host.attributes.maxPixelRatio, device.limits.maxTextureDimension2D);
  }

  #render(scene: DrawnScene, request: CanvasFrame, now: number, cameraMoved: boolean): void {
    const first = this.#first;
    this.#first = undefined;
    this.#applyRendering(scene);
    const { version } = scene.gaussians;
    const hasChanged = first === undefined && (cameraMoved || version !== this.#drawnVersion);
    this.#drawnVersion = version;
    const pixels = request.camera.width * request.camera.height;
    const goesOn = this.#host.camera.isMoving;
    const plan = this.pace.plan({ now, pixels, hasChanged, goesOn });
    const { levers } = plan;
    // Who has chosen a quality pays for no clock.
    const onTime =
      this.#host.attributes.quality === 'auto' ? (time: WorkTime) => this.pace.sample(plan, time) : undefined;
    if (first !== undefined) {
      scene.renderFirst(request).then(() => this.#afterFirst(scene, first), first.reject);
      return;
    }
    scene.render({ ...request, levers }, onTime);
    this.#prepareSoon(scene);
  }

  #afterFirst(scene: DrawnScene, { resolve }: Settle): void {
    resolve();
    this.#prepareSoon(scene);
  }

  /** Pictures in motion must not wait for pipelines: those that they may need are made soon after the first picture, and after a change of the quality to `auto`. */
  #prepareSoon(scene: DrawnScene): void {
    if (scene.isPrepared || this.#host.attributes.quality !== 'auto') return;
    this.#preparing ??= setTimeout(() => {
      this.#preparing = undefined;
      if (this.#scene === scene) scene.prepare(MOVING_LEVERS);
    }, PREPARE_AFTER_MS);
  }

  #applyRendering(scene: DrawnScene): void {
    const { quality, maxShDegree: shDegree } = this.#host.attributes;
    scene.setRendering({ quality: quality === 'auto' ? 'default' : quality, shDegree });
  }

  #finishUnseen(): void {
    if (!this.#host.size.isEmpty) return;
    this.#first?.resolve();
    this.#first = undefined;
  }

  #frameRequest(scene: DrawnScene, { width, height }: PixelSize): CanvasFrame | null {
    const surface = this.#surfaceFor(scene);
    if (surface === null) return null;
    const { canvas } = surface;
    // Setting a canvas's size clears it, even to the same size; here a frame follows at once.
    if (canvas.width !== width) canvas.width = width;
    if (canvas.height !== height) canvas.height = height;
    return { camera: this.#host.camera.view(width, height), surface };
  }

  /** null where the browser shows nothing of the kind on a canvas. */
  #surfaceFor(scene: DrawnScene): Surface | null {
    const take = (): Surface | null => (this.#surface = scene.surfaceOn(this.#host.canvas!));
    if (this.#surfaceOf !== scene && take() === null) {
      // What has drawn on this canvas keeps it.
      this.renewCanvas();
      take();
    }
    this.#surfaceOf = scene;
    return this.#surface;
  }
}
