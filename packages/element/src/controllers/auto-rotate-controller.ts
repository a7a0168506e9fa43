import type { ReactiveController, ReactiveControllerHost } from 'lit';
import { MAX_MOVER_STEP_MS, type Mover } from './mover.js';

export interface AutoRotateOptions {
  /** False while the camera must stand still, whatever the attributes say. */
  readonly mayTurn: () => boolean;
  /** Rest before the camera turns, ms. */
  readonly delayMs: () => number;
  readonly radiansPerSecond: () => number;
  readonly turnBy: (theta: number) => void;
  readonly requestFrame: () => void;
}

/** Turns the camera around the scene while nobody touches it, as if the scene stood on a turntable. */
export class AutoRotateController implements ReactiveController, Mover {
  readonly #options: AutoRotateOptions;
  #timer: ReturnType<typeof setTimeout> | undefined;
  #isTurning = false;
  #lastStep: number | undefined;

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
    // The scene turns to the right, seen from above against the clock, so the camera goes the other way.
    this.#options.turnBy((-this.#options.radiansPerSecond() * stepMs) / 1000);
    return true;
  }

  #stop(): void {
    clearTimeout(this.#timer);
    this.#timer = undefined;
    this.#isTurning = false;
    this.#lastStep = undefined;
  }
}
