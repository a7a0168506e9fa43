import type { ReactiveController, ReactiveControllerHost } from 'lit';
import type { Attributes } from '../attributes.js';
import type { CameraController } from './camera-controller.js';
import { MAX_MOVER_STEP_MS, type Mover } from './motion.js';

export interface AutoRotateHost {
  readonly attributes: Pick<Attributes, 'autoRotateDelay' | 'rotationPerSecond'>;
  readonly camera: Pick<CameraController, 'turnBy'>;
  /** False while the camera must not move, regardless of the attributes. */
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
   * The scene rotates to the right, counterclockwise from above, so the camera moves the other way; it reverses at a
   * limit.
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

  /** Pauses after a visitor has moved the camera. */
  rest(): void {
    this.#stop();
    if (!this.#of.mayTurn) return;
    this.#timer = setTimeout(() => this.start(), this.#of.attributes.autoRotateDelay);
  }

  /** Starts without a delay. */
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
    const step = (this.#of.attributes.rotationPerSecond * stepMs) / 1000;
    if (step === 0 || this.#of.camera.turnBy(this.#direction * step) !== 0) return true;
    this.#direction = -this.#direction;
    if (this.#of.camera.turnBy(this.#direction * step) !== 0) return true;
    // The limits leave no range.
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
