import { cameraFromProjection, multiply, type Camera } from '@gaussian-splat/core';
import { drawn } from '@gaussian-splat/renderer/webgl';
import type { SplatFilter, ShDegree } from '@gaussian-splat/core';
import { ViewOrder } from './view-order.js';
import {
  makeLayer,
  type XrFrame,
  type XrLayer,
  type XrPose,
  type XrSession,
  type XrSpace,
  type XrView,
} from './webxr.js';
import type { XrContext, XrScene } from './xr-scene.js';

/** Fraction of the headset's refresh interval that a frame may take on the GPU. */
const SHARE_OF_INTERVAL = 0.8;
/** Assumed refresh rate of a headset, Hz. */
const USUAL_RATE = 72;
/** Interval between measured frames, ms: quality adapts within seconds, because a head never rests. */
const MEASURE_MS = 1_000;
const MIN_SCALE = 0.5;
const SCALE_STEP = 0.85;
/** Meters. */
const [NEAR, FAR] = [0.05, 1000];
/** Background while the scene is loading. */
const GRAY = [0.2, 0.2, 0.21, 1] as const;

/** Provides the scene's transform for each frame. */
export interface XrGuide {
  /** Premultiplied, behind the splats. */
  readonly background: readonly [number, number, number, number];
  /**
   * Advances to a frame.
   * @returns the scene's own frame to the reference space, row-major; null while the scene has no place
   */
  place(frame: XrFrame, pose: XrPose, seconds: number): Float64Array | null;
  /** Draws below the splats of a view, with the camera in the reference space. */
  drawBelow?(camera: Camera, at: XrRectangle): void;
  /** Draws above the splats of a view. */
  drawAbove?(camera: Camera, at: XrRectangle): void;
}

/** Target rectangle of a view. */
export interface XrRectangle {
  readonly framebuffer: WebGLFramebuffer | null;
  readonly x: number;
  readonly y: number;
}

export interface XrRendering {
  readonly shDegree: ShDegree;
  readonly filter: SplatFilter | undefined;
  readonly byDistance: boolean;
  readonly spawn: () => Worker;
}

/** Draws a scene into a session, in the session's animation frames. */
export class XrLoop {
  readonly #session: XrSession;
  readonly #gl: WebGL2RenderingContext;
  readonly #layer: XrLayer;
  readonly #space: XrSpace;
  readonly #guide: XrGuide;
  #scene: XrScene | undefined;
  #rendering: XrRendering | undefined;
  #order: ViewOrder | undefined;
  #isOver = false;
  #last: number | undefined;
  #measuredAt = -Infinity;
  /** Fraction of the width and height of a view that is drawn. */
  scale = 1;
  /** Called with each frame that shows the scene. */
  onFrame: () => void = () => undefined;

  constructor(session: XrSession, { gl }: XrContext, space: XrSpace, guide: XrGuide) {
    this.#session = session;
    this.#gl = gl;
    this.#space = space;
    this.#guide = guide;
    this.#layer = makeLayer(session, gl);
    session.updateRenderState({ baseLayer: this.#layer, depthNear: NEAR, depthFar: FAR });
    session.requestAnimationFrame(this.#draw);
  }

  /** Time budget of a frame on the GPU, ms. */
  get targetMs(): number {
    return (SHARE_OF_INTERVAL * 1000) / (this.#session.frameRate ?? USUAL_RATE);
  }

  show(scene: XrScene, rendering: XrRendering): void {
    this.#scene = scene;
    this.#rendering = rendering;
    this.#order = new ViewOrder(scene, rendering.byDistance, rendering.spawn);
  }

  /** The drawn scene, once it is loaded. */
  get scene(): XrScene | undefined {
    return this.#scene;
  }

  /** Draws only splats whose position is not NaN. */
  crop(positions: Float32Array): void {
    if (!this.#scene || !this.#rendering) return;
    this.#order?.destroy();
    this.#order = new ViewOrder({ ...this.#scene, positions }, this.#rendering.byDistance, this.#rendering.spawn);
  }

  stop(): void {
    this.#isOver = true;
    this.#order?.destroy();
  }

  readonly #draw = (time: number, frame: XrFrame): void => {
    if (this.#isOver) return;
    this.#session.requestAnimationFrame(this.#draw);
    if (this.#gl.isContextLost()) return;
    const seconds = this.#last === undefined ? 0 : Math.min(0.1, (time - this.#last) / 1000);
    this.#last = time;
    const pose = frame.getViewerPose(this.#space);
    this.#clear();
    if (!pose) return;
    try {
      const place = this.#guide.place(frame, pose, seconds);
      if (place) this.#drawViews(pose.views, place, time);
    } catch (error) {
      reportError(error);
      this.#session.end().catch(() => undefined);
    }
  };

  #clear(): void {
    const gl = this.#gl;
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.#layer.framebuffer);
    gl.disable(gl.SCISSOR_TEST);
    gl.clearBufferfv(gl.COLOR, 0, this.#guide.background[3] < 1 || this.#scene ? this.#guide.background : GRAY);
  }

  #drawViews(views: readonly XrView[], place: Float64Array, time: number): void {
    const [scene, rendering] = [this.#scene, this.#rendering];
    if (!scene || !rendering) return;
    const seen = views.flatMap((view) => {
      const at = this.#layer.getViewport(view);
      return at && at.width > 0 && at.height > 0 ? [{ at, view }] : [];
    });
    const cameras = seen.map(({ at: { width, height }, view }) => {
      const size = { width, height, clipDepth: '-1..1' } as const;
      const room = cameraFromProjection(view.transform.inverse.matrix, view.projectionMatrix, size);
      return { room, camera: { ...room, worldToCamera: multiply(room.worldToCamera, place) } };
    });
    if (cameras.length === 0) return;
    this.#order?.update(cameras.map(({ camera }) => camera));
    const { shDegree, filter } = rendering;
    cameras.forEach(({ camera, room }, i) => {
      const at = { framebuffer: this.#layer.framebuffer, x: seen[i].at.x, y: seen[i].at.y };
      this.#guide.drawBelow?.(room, at);
      scene.renderer.render({ camera, shDegree, filter, accumulation: 'rgba16float', resolutionScale: this.scale });
      if (this.#guide.drawBelow) scene.renderer.present(undefined, { ...at, keeps: true });
      else scene.renderer.present(this.#guide.background, at);
      this.#guide.drawAbove?.(room, at);
    });
    this.onFrame();
    if (time - this.#measuredAt > MEASURE_MS) this.#measure(time);
  }

  #measure(time: number): void {
    this.#measuredAt = time;
    const begin = performance.now();
    drawn(this.#gl).then(
      ({ now }) => this.adapt(now - begin),
      () => undefined,
    );
  }

  /** Adapts the number of pixels to the measured time. @param milliseconds frame time on the GPU, at most */
  adapt(milliseconds: number): void {
    if (milliseconds > this.targetMs) this.scale = Math.max(MIN_SCALE, this.scale * SCALE_STEP);
    else if (milliseconds < this.targetMs / 2) this.scale = Math.min(1, this.scale / SCALE_STEP);
  }
}
