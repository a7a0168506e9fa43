import type { Camera, Matrix4 } from '@gaussian-splat/core';
import type { SplatRow } from '../../shared/splat-file.js';
import type { XrFrame, XrView, XrViewport } from './webxr.js';

/** A view of a frame, usually of one eye, with its cameras. */
export interface XrEye {
  readonly view: XrView;
  /** Rectangle of the view in the target, pixels. */
  readonly at: XrViewport;
  /** Camera of the view in the reference space of the session, meters. */
  readonly room: Camera;
  /** Camera of the view in scene coordinates. */
  readonly camera: Camera;
}

/** Red, green, blue and alpha, premultiplied, 0..1. */
export type XrColor = readonly [number, number, number, number];

/** Draws additional content below and above the splats of a view. */
export interface XrBetween {
  /** Draws below the splats of a view. */
  drawBelow?(eye: XrEye): void;
  /** Draws above the splats of a view. */
  drawAbove?(eye: XrEye): void;
}

/**
 * A few splats that the element has created: a ring at the destination of a teleport, or the shadow under an object.
 */
export interface XrMarker {
  /**
   * Draws the marker over the current image of a view.
   * @param toWorld Transform from the coordinates of the marker to the reference space.
   */
  draw(eye: XrEye, toWorld: Matrix4): void;
}

/** Draws the frames of a session, with WebGL 2 or with WebGPU. */
export interface XrDrawing {
  /** Depth range that the session's projection matrices must have. */
  readonly clipDepth: '0..1' | '-1..1';
  /** The part of the session's render state that sets the target. */
  readonly renderState: object;
  /** Whether the drawing uses the splats of the page, so that the session ends when they are destroyed. */
  readonly isOfPage: boolean;
  readonly isLost: boolean;
  /** Whether the scene is loaded. */
  readonly isOpen: boolean;
  /** Called if the GPU is lost, with a description of the loss. */
  onLost: (what: string) => void;
  /** Loads the scene. Fulfills when it can be drawn; rejects with the signal's reason. */
  open(signal: AbortSignal): Promise<void>;
  /** Begins a frame, and clears the target to a color. */
  begin(frame: XrFrame, views: readonly XrView[], color: XrColor): void;
  /** Rectangle of a view in the target; null for a view that is not drawn. */
  viewportOf(view: XrView): XrViewport | null;
  /**
   * Draws the splats into all views.
   * @param scale Fraction of the width and height of each view that is drawn, 0..1.
   * @param now requestAnimationFrame's clock, ms.
   */
  draw(eyes: readonly XrEye[], background: XrColor, between: XrBetween, scale: number, now: number): void;
  /** Creates a marker. @param rows Splats in one plane, so that their order does not matter. */
  marker(rows: readonly SplatRow[], signal: AbortSignal): XrMarker;
  /** Fulfills when the GPU has finished the submitted frames, with the time of that by `performance.now`. */
  finished(): Promise<number>;
  destroy(): void;
}
