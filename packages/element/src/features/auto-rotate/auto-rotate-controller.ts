import type { ReactiveController } from 'lit';
import { MAX_MOVER_STEP_MS } from '../../viewer/motion.js';
import type { Feature } from '../../viewer/features.js';
import type { Viewer } from '../../viewer/viewer.js';

/** Rotates the camera around the scene while no visitor interacts, as on a turntable. */
export class AutoRotateController implements ReactiveController, Feature {
  readonly #viewer: Viewer;
  #timer: ReturnType<typeof setTimeout> | undefined;
  #isTurning = false;
  #lastStep: number | undefined;
  /**
   * Sign of the camera's rotation. With -1 the scene seems to rotate to the right, counterclockwise from above. The
   * sign changes at a limit of the orbit.
   */
  #direction = -1;

  constructor(viewer: Viewer) {
    this.#viewer = viewer;
    viewer.element.addController(this);
  }

  /**
   * Whether the camera may rotate: the attribute `auto-rotate` is set, the scene is visible, motion is not reduced or
   * stopped, and the frame has no keyboard focus.
   */
  get #mayTurn(): boolean {
    const { attributes, mayMove, surface } = this.#viewer;
    return attributes.autoRotate && mayMove && !surface?.matches(':focus-visible');
  }

  hostUpdated(): void {
    if (!this.#mayTurn) this.hostDisconnected();
    else if (!this.#isTurning && this.#timer === undefined) this.rest();
  }

  /** Stops the rotation, and starts it again after `autoRotateDelay` milliseconds without another call. */
  rest(): void {
    this.hostDisconnected();
    if (!this.#mayTurn) return;
    this.#timer = setTimeout(() => this.start(), this.#viewer.attributes.autoRotateDelay);
  }

  /** Starts the rotation without a delay. */
  start(): void {
    this.hostDisconnected();
    if (!this.#mayTurn) return;
    this.#isTurning = true;
    this.#viewer.requestFrame();
  }

  advance(now: number): boolean {
    if (!this.#isTurning) return false;
    if (!this.#mayTurn) {
      this.hostDisconnected();
      return false;
    }
    const stepMs = this.#lastStep === undefined ? 0 : Math.min(MAX_MOVER_STEP_MS, now - this.#lastStep);
    this.#lastStep = now;
    const speed = this.#viewer.attributes.rotationPerSecond;
    const step = (speed * stepMs) / 1000;
    // A change of the attribute requests the next frame.
    if (speed === 0) return false;
    if (step === 0 || this.#viewer.camera.turnBy(this.#direction * step) !== 0) return true;
    this.#direction = -this.#direction;
    if (this.#viewer.camera.turnBy(this.#direction * step) !== 0) return true;
    // The limits of the orbit allow no rotation in either direction.
    this.#isTurning = false;
    return false;
  }

  hostDisconnected(): void {
    clearTimeout(this.#timer);
    this.#timer = undefined;
    this.#isTurning = false;
    this.#lastStep = undefined;
  }
}
