/**
 * A motion of the camera along a path over time. Each frame advances it until it arrives or something else moves the
 * camera.
 */
import type { CameraPose } from '../../viewer/camera/orbit.js';
import type { CameraController } from '../../viewer/camera-controller.js';

/** Milliseconds after its planned end at which a flight without frames arrives, for example in a hidden page. */
const GRACE_MS = 100;

export class Flight {
  readonly #camera: CameraController;
  readonly #path: (elapsedMs: number) => CameraPose;
  readonly #durationMs: number;
  #start: number | undefined;
  #placed: CameraPose | undefined;
  #end: ((arrived: boolean) => void) | undefined;
  readonly #timer: ReturnType<typeof setTimeout> | undefined;
  /** Fulfills at the end: true on arrival, false if the flight was canceled. */
  readonly finished: Promise<boolean>;

  /**
   * @param path Returns the pose for the milliseconds since the start.
   * @param durationMs Duration in milliseconds: 0 jumps to the end, Infinity never arrives.
   */
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

  /**
   * Moves the camera to its pose at a time, or cancels the flight if something else has moved the camera.
   * @param now Time of requestAnimationFrame, milliseconds.
   */
  advance(now: number): void {
    if (this.isOver) return;
    // A visitor, an attribute or another scene has moved the camera.
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
