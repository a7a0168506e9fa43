import type { ReactiveController, ReactiveControllerHost } from 'lit';
import { MAX_MOVER_STEP_MS, type Mover } from './mover.js';

export interface AutoRotateOptions {
  /** False while the camera must stand still, whatever the attributes say. */
  readonly mayTurn: () => boolean;
  /** Rest before the camera turns, ms. */
  readonly delayMs: () => number;
  readonly radiansPerSecond: () => number;
  /** Returns how far the limits let it. */
  readonly turnBy: (theta: number) => number;
  readonly requestFrame: () => void;
}

/** Turns the camera around the scene while nobody touches it, as if the scene stood on a turntable. */
export class AutoRotateController implements ReactiveController, Mover {
  readonly #options: AutoRotateOptions;
  #timer: ReturnType<typeof setTimeout> | undefined;
  #isTurning = false;
  #lastStep: number | undefined;
  /** The scene turns to the right, seen from above against the clock, so the camera goes the other way; and back from where it may go no farther. */
  #direction = -1;

  constructor(host: ReactiveControllerHost, options: AutoRotateOptions) {
    this.#options = options;
    host.addController(this);
  }

  hostUpdated(): void {
    if (!this.#options.mayTurn()) this.#stop();
    else if (!this.#isTurning && this.#timer === undefined) this.rest();
  }

  hostDisconnected(): void {
    this.#stop();
  }

  /** Somebody moved the camera: it stands still for a while. */
  rest(): void {
    this.#stop();
    if (!this.#options.mayTurn()) return;
    this.#timer = setTimeout(() => this.start(), this.#options.delayMs());
  }

  /** Turns without a rest before it. */
  start(): void {
    this.#stop();
    if (!this.#options.mayTurn()) return;
    this.#isTurning = true;
    this.#options.requestFrame();
  }

  advance(now: number): boolean {
    if (!this.#isTurning) return false;
    if (!this.#options.mayTurn()) {
      this.#stop();
      return false;
    }
    const stepMs = this.#lastStep === undefined ? 0 : Math.min(MAX_MOVER_STEP_MS, now - this.#lastStep);
    this.#lastStep = now;
    const step = (this.#options.radiansPerSecond() * stepMs) / 1000;
    if (step === 0 || this.#options.turnBy(this.#direction * step) !== 0) return true;
    this.#direction = -this.#direction;
    if (this.#options.turnBy(this.#direction * step) !== 0) return true;
    // It may go nowhere.
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
