import type { ReactiveController, ReactiveControllerHost } from 'lit';
import type { Attributes } from '../attributes.js';
import type { CameraController } from './camera-controller.js';
import { MAX_MOVER_STEP_MS, type Mover } from './motion.js';

export interface AutoRotateHost {
  readonly attributes: Pick<Attributes, 'autoRotateDelay' | 'rotationPerSecond'>;
  readonly camera: Pick<CameraController, 'turnBy'>;
  /**
   * Whether the camera may rotate: the attribute `auto-rotate` is set, the scene is visible, motion is not reduced or
   * stopped, and the frame has no keyboard focus.
   */
  readonly mayTurn: boolean;
  requestFrame(): void;
}

/** Rotates the camera around the scene while no visitor interacts, as on a turntable. */
export class AutoRotateController implements ReactiveController, Mover {
  readonly #of: AutoRotateHost;
  #timer: ReturnType<typeof setTimeout> | undefined;
  #isTurning = false;
  #lastStep: number | undefined;
  /**
   * Sign of the camera's rotation. With -1 the scene seems to rotate to the right, counterclockwise from above. The
   * sign changes at a limit of the orbit.
   */
  #direction = -1;

  constructor(host: ReactiveControllerHost, of: AutoRotateHost) {
    this.#of = of;
    host.addController(this);
  }

  hostUpdated(): void {
    if (!this.#of.mayTurn) this.#stop();
    else if (!this.#isTurning && this.#timer === undefined) this.rest();
  }

  hostDisconnected(): void {
    this.#stop();
  }

  /** Stops the rotation, and starts it again after `autoRotateDelay` milliseconds without another call. */
  rest(): void {
    this.#stop();
    if (!this.#of.mayTurn) return;
    this.#timer = setTimeout(() => this.start(), this.#of.attributes.autoRotateDelay);
  }

  /** Starts the rotation without a delay. */
  start(): void {
    this.#stop();
    if (!this.#of.mayTurn) return;
    this.#isTurning = true;
    this.#of.requestFrame();
  }

  advance(now: number): boolean {
    if (!this.#isTurning) return false;
    if (!this.#of.mayTurn) {
      this.#stop();
      return false;
    }
    const stepMs = this.#lastStep === undefined ? 0 : Math.min(MAX_MOVER_STEP_MS, now - this.#lastStep);
    this.#lastStep = now;
    const speed = this.#of.attributes.rotationPerSecond;
    const step = (speed * stepMs) / 1000;
    // A change of the attribute requests the next frame.
    if (speed === 0) return false;
    if (step === 0 || this.#of.camera.turnBy(this.#direction * step) !== 0) return true;
    this.#direction = -this.#direction;
    if (this.#of.camera.turnBy(this.#direction * step) !== 0) return true;
    // The limits of the orbit allow no rotation in either direction.
    this.#isTurning = false;
    return false;
  }

  #stop(): void {
    clearTimeout(this.#timer);
    this.#timer = undefined;
    this.#isTurning = false;
    this.#lastStep = undefined;
  }
}
