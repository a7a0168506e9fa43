import { cameraFromProjection, multiply } from '@gaussian-splat/core';
import type { XrFrame, XrPose, XrSession, XrSpace, XrView } from './webxr.js';
import type { XrBetween, XrColor, XrDrawing, XrEye } from './xr-drawing.js';

/** Fraction of the headset's refresh interval that a frame may take on the GPU. */
const SHARE_OF_INTERVAL = 0.8;
/** Assumed refresh rate of a headset that does not report its rate, Hz. */
const USUAL_RATE = 72;
/**
 * Interval between measured frames, milliseconds. The resolution adapts within seconds, because a head is never at
 * rest.
 */
const MEASURE_MS = 1_000;
const MIN_SCALE = 0.5;
const SCALE_STEP = 0.85;
/** Distances of the near and far planes, meters. */
const [NEAR, FAR] = [0.05, 1000];
/** Background while the scene is loading. */
const GRAY = [0.2, 0.2, 0.21, 1] as const;

/** Provides the transform of the scene for each frame. */
export interface XrGuide extends XrBetween {
  /** Color behind the splats, premultiplied. */
  readonly background: XrColor;
  /**
   * Advances to a frame.
   * @param seconds Time since the previous frame.
   * @returns the transform from scene coordinates to the reference space, 4x4, row-major; null while the scene is
   * not placed
   */
  place(frame: XrFrame, pose: XrPose, seconds: number): Float64Array | null;
}

/** Runs the animation frames of a session. */
export class XrLoop {
  readonly #session: XrSession;
  readonly #drawing: XrDrawing;
  readonly #space: XrSpace;
  readonly #guide: XrGuide;
  #isOver = false;
  #last: number | undefined;
  #measuredAt = -Infinity;
  /** Fraction of the width and height of a view that is drawn, 0..1. */
  scale = 1;

  constructor(session: XrSession, drawing: XrDrawing, space: XrSpace, guide: XrGuide) {
    this.#session = session;
    this.#drawing = drawing;
    this.#space = space;
    this.#guide = guide;
    session.updateRenderState({ ...drawing.renderState, depthNear: NEAR, depthFar: FAR });
    session.requestAnimationFrame(this.#draw);
  }

  /** Time that a frame may take on the GPU, milliseconds. */
  get targetMs(): number {
    return (SHARE_OF_INTERVAL * 1000) / (this.#session.frameRate ?? USUAL_RATE);
  }

  stop(): void {
    this.#isOver = true;
  }

  readonly #draw = (time: number, frame: XrFrame): void => {
    if (this.#isOver) return;
    this.#session.requestAnimationFrame(this.#draw);
    if (this.#drawing.isLost) return;
    const seconds = this.#last === undefined ? 0 : Math.min(0.1, (time - this.#last) / 1000);
    this.#last = time;
    const pose = frame.getViewerPose(this.#space);
    try {
      const { background } = this.#guide;
      this.#drawing.begin(frame, pose?.views ?? [], background[3] < 1 || this.#drawing.isOpen ? background : GRAY);
      const place = pose && this.#guide.place(frame, pose, seconds);
      if (place && this.#drawing.isOpen) this.#drawViews(pose.views, place, time);
    } catch (error) {
      reportError(error);
      this.#session.end().catch(() => undefined);
    }
  };

  #drawViews(views: readonly XrView[], place: Float64Array, time: number): void {
    const { clipDepth } = this.#drawing;
    const eyes = views.flatMap((view): XrEye[] => {
      const at = this.#drawing.viewportOf(view);
      if (!at || at.width === 0 || at.height === 0) return [];
      const size = { width: at.width, height: at.height, clipDepth };
      const room = cameraFromProjection(view.transform.inverse.matrix, view.projectionMatrix, size);
      return [{ view, at, room, camera: { ...room, worldToCamera: multiply(room.worldToCamera, place) } }];
    });
    if (eyes.length === 0) return;
    this.#drawing.draw(eyes, this.#guide.background, this.#guide, this.scale, time);
    if (time - this.#measuredAt > MEASURE_MS) this.#measure(time);
  }

  #measure(time: number): void {
    this.#measuredAt = time;
    const begin = performance.now();
    this.#drawing.finished().then(
      (end) => this.adapt(end - begin),
      () => undefined,
    );
  }

  /**
   * Adapts the resolution to a measured frame, and the refresh rate if the lowest resolution is too slow.
   * @param milliseconds Upper bound of the frame time on the GPU.
   */
  adapt(milliseconds: number): void {
    if (milliseconds > this.targetMs) {
      if (this.scale === MIN_SCALE) this.#lowerRate();
      this.scale = Math.max(MIN_SCALE, this.scale * SCALE_STEP);
    } else if (milliseconds < this.targetMs / 2) this.scale = Math.min(1, this.scale / SCALE_STEP);
  }

  /** Requests the next lower refresh rate of the headset, but not one below the usual rate. */
  #lowerRate(): void {
    const { frameRate = USUAL_RATE, supportedFrameRates = [] } = this.#session;
    const lower = [...supportedFrameRates].filter((rate) => rate >= USUAL_RATE && rate < frameRate);
    if (lower.length > 0) this.#session.updateTargetFrameRate?.(Math.max(...lower)).catch(() => undefined);
  }
}
