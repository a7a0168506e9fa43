/**
 * A camera motion along a path over time, advanced per frame until it arrives or the camera is moved by something else.
 */
import type { CameraPose } from '../camera/orbit.js';
import type { CameraController } from '../controllers/camera-controller.js';

/** Grace period after its end for a flight whose frames have stopped, ms. */
const GRACE_MS = 100;

export class Flight {
  readonly #camera: CameraController;
  readonly #path: (elapsedMs: number) => CameraPose;
  readonly #durationMs: number;
  #start: number | undefined;
  #placed: CameraPose | undefined;
  #end: ((arrived: boolean) => void) | undefined;
  readonly #timer: ReturnType<typeof setTimeout> | undefined;
  /** Fulfills at the end with true on arrival. */
  readonly finished: Promise<boolean>;

  /** @param durationMs 0 jumps; Infinity never arrives */
  constructor(camera: CameraController, path: (elapsedMs: number) => CameraPose, durationMs: number) {
    this.#camera = camera;
    this.#path = path;
    this.#durationMs = durationMs;
    this.finished = new Promise((resolve) => (this.#end = resolve));
    if (durationMs === 0) this.#arrive();
    else if (Number.isFinite(durationMs)) this.#timer = setTimeout(() => this.#arrive(), durationMs + GRACE_MS);
  }

  get isOver(): boolean {
    return this.#end === undefined;
  }

  /** @param now requestAnimationFrame's clock, ms */
  advance(now: number): void {
    if (this.isOver) return;
    // User input, attributes or another scene that moves the camera takes over.
    if (this.#isElsewhere) return this.cancel();
    this.#start ??= now;
    const elapsed = now - this.#start;
    if (elapsed >= this.#durationMs) this.#arrive();
    else this.#place(elapsed);
  }

  cancel(): void {
    this.#finish(false);
  }

  #arrive(): void {
    if (this.#isElsewhere) return this.cancel();
    this.#place(this.#durationMs);
    this.#finish(true);
  }

  get #isElsewhere(): boolean {
    const [placed, goal] = [this.#placed, this.#camera.goal];
    return (
      placed !== undefined && Object.entries(placed).some(([key, value]) => goal[key as keyof CameraPose] !== value)
    );
  }

  #place(elapsedMs: number): void {
    this.#camera.moveTo(this.#path(elapsedMs));
    this.#placed = this.#camera.goal;
  }

  #finish(arrived: boolean): void {
    clearTimeout(this.#timer);
    this.#end?.(arrived);
    this.#end = undefined;
  }
}
