import { Damper } from './damper.js';
import { orbitAxes, type Pose } from './orbit.js';

/** Smallest and largest value that each part of a pose may take. */
export interface PoseLimits {
  readonly min: Pose;
  readonly max: Pose;
}

const KEYS = ['theta', 'phi', 'radius', 'x', 'y', 'z', 'fieldOfView'] as const;
const everywhere = (value: number): Pose => ({
  theta: value,
  phi: value,
  radius: value,
  x: value,
  y: value,
  z: value,
  fieldOfView: value,
});

/**
 * A camera that turns around a target: where it is now, where it is going, and the damped way between.
 * Knows no page, no attribute and no scene.
 */
export class OrbitCamera {
  #now: Pose;
  #goal: Pose;
  #limits: PoseLimits = { min: everywhere(-Infinity), max: everywhere(Infinity) };
  readonly #dampers = KEYS.map(() => new Damper());

  constructor(pose: Pose) {
    this.#now = pose;
    this.#goal = pose;
  }

  /** Where the camera is. */
  get now(): Pose {
    return this.#now;
  }

  /** Where it is going; the same values as {@link now} when it stands still. */
  get goal(): Pose {
    return this.#goal;
  }

  /** True while {@link step} still has something to do. */
  get moving(): boolean {
    return KEYS.some((key) => this.#now[key] !== this.#goal[key]);
  }

  /** Bounds of every goal from now on; the present goal is brought within them. */
  set limits(limits: PoseLimits) {
    this.#limits = limits;
    this.setGoal({});
  }

  /** Changes parts of the goal, within the limits. */
  setGoal(changes: Partial<Pose>): void {
    const { min, max } = this.#limits;
    const wanted = { ...this.#goal, ...changes };
    const goal = { ...wanted };
    for (const key of KEYS) goal[key] = Math.min(max[key], Math.max(min[key], wanted[key]));
    this.#goal = goal;
  }

  /** Takes full turns off the present azimuth, so that the way to the goal is the short one. */
  unwind(): void {
    const turns = Math.round((this.#goal.theta - this.#now.theta) / (2 * Math.PI));
    this.#now = { ...this.#now, theta: this.#now.theta + turns * 2 * Math.PI };
  }

  /** Ends all motion at the goal. */
  jumpToGoal(): void {
    this.#now = this.#goal;
    for (const damper of this.#dampers) damper.stop();
  }

  /**
   * One step of the damped motion.
   * @param stepMs time since the last step, milliseconds.
   * @param decayMs time constant of the motion, milliseconds; 0 jumps.
   * @returns whether the camera has moved.
   */
  step(stepMs: number, decayMs: number): boolean {
    if (!this.moving) return false;
    const now = { ...this.#now };
    KEYS.forEach((key, i) => {
      const scale = key === 'theta' || key === 'phi' || key === 'fieldOfView' ? 1 : this.#goal.radius;
      now[key] = this.#dampers[i].step(now[key], this.#goal[key], stepMs, decayMs, scale);
    });
    this.#now = now;
    return true;
  }

  /** Turns the goal around its target by angles in radians. */
  orbitBy(theta: number, phi: number): void {
    this.setGoal({ theta: this.#goal.theta + theta, phi: this.#goal.phi + phi });
  }

  /** Multiplies the distance to the target. */
  zoomBy(factor: number): void {
    this.setGoal({ radius: this.#goal.radius * factor });
  }

  /**
   * Moves the target in the plane of the picture.
   * @param right share of the picture's height by which the camera moves to its right.
   * @param up the same, upwards.
   */
  panBy(right: number, up: number): void {
    const goal = this.#goal;
    const height = 2 * goal.radius * Math.tan(goal.fieldOfView / 2);
    const axes = orbitAxes(goal.theta, goal.phi);
    const along = (axis: 0 | 1 | 2): number => height * (right * axes.right[axis] + up * axes.up[axis]);
    this.setGoal({ x: goal.x + along(0), y: goal.y + along(1), z: goal.z + along(2) });
  }
}
