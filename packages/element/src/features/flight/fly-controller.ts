import type { ReactiveController } from 'lit';
import { MAX_MOVER_STEP_MS } from '../../viewer/motion.js';
import type { Feature } from '../../viewer/features.js';
import type { Viewer } from '../../viewer/viewer.js';

/** Help text for the keys. */
const KEYS =
  'Arrow keys look around, W and S fly forward and back, A and D to the sides, E and Q up and down, with Shift faster, ' +
  'Home brings the view back.';

type Direction = readonly [right: number, up: number, forward: number];

/**
 * Directions of flight, by the physical position of keys (`KeyboardEvent.code`), so that the keys lie under the left
 * hand on every keyboard.
 */
const DIRECTIONS: Readonly<Record<string, Direction>> = {
  KeyW: [0, 0, 1],
  KeyS: [0, 0, -1],
  KeyD: [1, 0, 0],
  KeyA: [-1, 0, 0],
  KeyE: [0, 1, 0],
  KeyQ: [0, -1, 0],
};
/** Speed of flight, in radii of the scene per second. */
const SPEED = 0.5;
const FAST = 4;
/** Motion of a press in its first event, as milliseconds of flight: a short press may end before the next frame. */
const FIRST_STEP_MS = 50;

/**
 * Flies while keys are held: W and S along the view, A and D to the sides, E and Q up and down. Shift makes the flight
 * `FAST` times faster.
 */
export class FlyController implements ReactiveController, Feature {
  readonly #viewer: Viewer;
  readonly #held = new Map<string, Direction>();
  #isFast = false;
  #lastStep: number | undefined;
  #listening: AbortController | undefined;

  constructor(viewer: Viewer) {
    this.#viewer = viewer;
    viewer.element.addController(this);
  }

  get #mayFly(): boolean {
    return this.#viewer.input.enabled && this.#viewer.navigation === 'fly';
  }

  keys(): string | undefined {
    return this.#mayFly ? (this.#viewer.strings['keys-fly'] ?? KEYS) : undefined;
  }

  hostUpdated(): void {
    const { surface } = this.#viewer;
    if (!this.#mayFly || surface === null) return this.hostDisconnected();
    if (this.#listening !== undefined) return;
    this.#listening = new AbortController();
    const { signal } = this.#listening;
    surface.addEventListener('keydown', this.#onDown, { signal });
    surface.addEventListener('keyup', this.#onUp, { signal });
    surface.addEventListener('blur', this.#release, { signal });
  }

  hostDisconnected(): void {
    this.#listening?.abort();
    this.#listening = undefined;
    this.#release();
  }

  advance(now: number): boolean {
    if (this.#held.size === 0) return false;
    const stepMs = this.#lastStep === undefined ? 0 : Math.min(MAX_MOVER_STEP_MS, now - this.#lastStep);
    this.#lastStep = now;
    const sum = (axis: 0 | 1 | 2): number => [...this.#held.values()].reduce((total, held) => total + held[axis], 0);
    this.#move([sum(0), sum(1), sum(2)], stepMs);
    return true;
  }

  #move([right, up, forward]: Direction, stepMs: number): void {
    const way = (this.#viewer.camera.bounds.radius * SPEED * (this.#isFast ? FAST : 1) * stepMs) / 1000;
    if (way === 0) return;
    this.#viewer.touched();
    this.#viewer.camera.moveBy(way * right, way * up, way * forward);
  }

  readonly #onDown = (event: KeyboardEvent): void => {
    const direction = DIRECTIONS[event.code];
    if (direction === undefined || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    this.#isFast = event.shiftKey;
    if (!event.repeat) this.#move(direction, FIRST_STEP_MS);
    this.#held.set(event.code, direction);
    this.#viewer.requestFrame();
  };

  readonly #onUp = (event: KeyboardEvent): void => {
    this.#isFast = event.shiftKey;
    this.#held.delete(event.code);
    // macOS does not report the release of other keys while the Meta key is held.
    if (event.key === 'Meta') this.#held.clear();
    if (this.#held.size === 0) this.#lastStep = undefined;
  };

  readonly #release = (): void => {
    this.#held.clear();
    this.#lastStep = undefined;
  };
}
