import type { Camera, Vector3 } from '@gaussian-splat/core';
import { angleBetween, axisOf, type DepthOrder } from './depth-order.js';
import type { FrameTimer } from './gpu/pass-timer.js';
import type { PageTable } from './page-table.js';

/** Frames without a change after which a scene that changes now and then counts as still. */
const STILL_FRAMES = 8;

/**
 * Whether the content of the scenes stands still. An order of all splats pays only where many frames use it: scenes that are being
 * written frame by frame have their visible splats sorted instead.
 */
export class ContentWatch {
  #version: number | undefined;
  #stillFrames = 0;

  /** Notes a frame that is drawn with a version of the content; 0 is content that never changes. */
  isStill(version: number): boolean {
    this.#stillFrames = version === this.#version ? this.#stillFrames + 1 : 0;
    this.#version = version;
    return version === 0 || this.#stillFrames >= STILL_FRAMES;
  }
}

/** Radians under which a camera counts as not having turned. */
const STILL = 1e-7;
/** Most splats whose order is kept while the camera turns: beyond, the frames that sort all of them would take several times as long as the others. */
const MOST_KEPT = 1 << 20;
/** Turns that an order must last to be made while the camera turns: sorting all splats costs more than sorting the visible ones. */
const LEAST_TURNS = 2;
/** Frames of a turning camera after which the order of all splats, useless meanwhile, is given up. */
const TURNING_FRAMES = 64;

/** What decides besides the camera. */
export interface OrderOccasion {
  /** Radians that a camera may turn before its order is made anew. */
  readonly sortAngle: number;
  /** The frame can be drawn with an order of all splats only. */
  readonly isAskedFor: boolean;
  readonly timer: FrameTimer | undefined;
}

/**
 * Whether all splats are put in order, which lasts while the camera does not turn, or only the visible ones are sorted, which is less work and lasts
 * for one frame.
 */
export class OrderPolicy {
  readonly #table: PageTable;
  readonly #depthOrder: DepthOrder;
  readonly #content = new ContentWatch();
  #lastAxis: Vector3 | undefined;
  #turningFrames = 0;

  constructor(table: PageTable, depthOrder: DepthOrder) {
    this.#table = table;
    this.#depthOrder = depthOrder;
  }

  /**
   * Sees to an order of all splats where one is of use: for the first frame, for the first of those between which the camera
   * does not turn, and while it turns so slowly that frames share an order. Else, and where the content changes, only the visible
   * splats are sorted. Call {@link settle} after submitting.
   * @returns whether the order serves this frame
   */
  prepare(encoder: GPUCommandEncoder, camera: Camera, { sortAngle, isAskedFor, timer }: OrderOccasion): boolean {
    const depthOrder = this.#depthOrder;
    const kept = this.#keptAngle(sortAngle);
    const axis = axisOf(camera);
    const turned = this.#lastAxis === undefined ? 0 : angleBetween(this.#lastAxis, axis);
    this.#lastAxis = axis;
    // Of a streamed scene most splats are not in view, and others come and go: sorting all of them never pays.
    const isStill = this.#content.isStill(this.#table.version) && !this.#table.isStreamed;
    if (depthOrder.serves(camera, kept)) {
      this.#turningFrames = 0;
      return true;
    }
    const isUseful = isAskedFor || (isStill && turned <= Math.max(Math.min(STILL, kept), kept / LEAST_TURNS));
    if (isUseful && depthOrder.isPossible) {
      depthOrder.record(encoder, camera, timer);
      return true;
    }
    if (++this.#turningFrames === TURNING_FRAMES) depthOrder.release();
    return false;
  }

  /** Frees what only the sorting needed. Where all splats are sorted again and again, by a lever that reuses orders or because each frame asks for it, the buffers are kept. */
  settle({ sortAngle, isAskedFor }: Omit<OrderOccasion, 'timer'>): void {
    if (this.#keptAngle(sortAngle) <= STILL && !isAskedFor) this.#depthOrder.settle();
  }

  #keptAngle(sortAngle: number): number {
    return this.#depthOrder.length > MOST_KEPT ? Math.min(STILL, sortAngle) : sortAngle;
  }
}
