import type { Vector3 } from '@gaussian-splat/core';
import { Damper } from './damper.js';
import { eyeOfPose, orbitAxes, type CameraPose } from './orbit.js';

/** Point that stays fixed in a motion: the target that the camera orbits, or the eye of a flying camera. */
export type Pivot = 'target' | 'eye';

/** Lower and upper limit of each component of a pose. */
export interface CameraLimits {
  readonly min: CameraPose;
  readonly max: CameraPose;
}

/** Components of a pose that define its position. The others define the view from there. */
const PLACE = ['x', 'y', 'z'] as const;
const VIEW = ['theta', 'phi', 'radius', 'fieldOfView'] as const;
const KEYS = [...VIEW, ...PLACE];
const everywhere = (value: number): CameraPose =>
  Object.fromEntries(KEYS.map((key) => [key, value])) as unknown as CameraPose;

/**
 * A camera that orbits a target: its current pose, its goal, and the damped motion between them. Independent of page,
 * attributes and scene.
 */
export class OrbitCamera {
  #now: CameraPose;
  #goal: CameraPose;
  #limits: CameraLimits = { min: everywhere(-Infinity), max: everywhere(Infinity) };
  readonly #dampers = KEYS.map(() => new Damper());
  #pivot: Pivot = 'target';
  /**
   * Whether the eye has been placed directly, as on a floor. Limits of the target then do not apply, because they would move the eye. A change of the
   * pivot ends it.
   */
  eyeIsFree = false;

  constructor(pose: CameraPose) {
    this.#now = pose;
    this.#goal = pose;
  }

  /** The current pose. */
  get now(): CameraPose {
    return this.#now;
  }

  /** The pose that the camera moves to; equal to {@link now} at rest. */
  get goal(): CameraPose {
    return this.#goal;
  }

  /** Whether the current pose differs from the goal. */
  get moving(): boolean {
    return KEYS.some((key) => this.#now[key] !== this.#goal[key]);
  }

  get pivot(): Pivot {
    return this.#pivot;
  }

  /** Sets the fixed point. `eye` keeps the position of a camera that looks around, also on the way to its goal. */
  set pivot(pivot: Pivot) {
    if (pivot === this.#pivot) return;
    this.#pivot = pivot;
    this.eyeIsFree = false;
    // The velocities of the dampers belong to the previous pivot.
    for (const damper of this.#dampers) damper.stop();
  }

  /** Sets the limits of all further goals, and clamps the current goal to them. */
  set limits(limits: CameraLimits) {
    this.#limits = limits;
    this.setGoal({});
  }

  /** Changes components of the goal, within the limits. */
  setGoal(changes: Partial<CameraPose>): void {
    const { min, max } = this.#limits;
    const goal = { ...this.#goal, ...changes };
    for (const key of this.eyeIsFree ? VIEW : KEYS) goal[key] = Math.min(max[key], Math.max(min[key], goal[key]));
    this.#goal = goal;
  }

  /** Adds full turns to the current azimuth, so that it differs from the goal by at most half a turn. */
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
   * Advances the damped motion by one step.
   * @param stepMs Time since the last step, milliseconds.
   * @param decayMs Time constant of the motion, milliseconds; 0 jumps to the goal.
   * @returns Whether the camera has moved.
   */
  step(stepMs: number, decayMs: number): boolean {
    if (!this.moving) return false;
    const from = this.#onCourse(this.#now);
    const to = this.#onCourse(this.#goal);
    const now = { ...from };
    KEYS.forEach((key, i) => {
      const scale = key === 'theta' || key === 'phi' || key === 'fieldOfView' ? 1 : to.radius;
      now[key] = this.#dampers[i].step(from[key], to[key], stepMs, decayMs, scale);
    });
    // The last step sets the exact goal, without the rounding error of the conversion through the eye.
    this.#now = KEYS.every((key) => now[key] === to[key]) ? this.#goal : this.#offCourse(now);
    return true;
  }

  /**
   * Returns a pose whose position is that of the pivot: of the target, or of the eye. Its damped motion keeps an
   * unchanged pivot fixed.
   */
  #onCourse(pose: CameraPose): CameraPose {
    if (this.#pivot === 'target') return pose;
    const [x, y, z] = eyeOfPose(pose);
    return { ...pose, x, y, z };
  }

  #offCourse(pose: CameraPose): CameraPose {
    return this.#pivot === 'target' ? pose : withTargetAhead(pose);
  }

  /**
   * Rotates current pose and goal by the same azimuth around the {@link pivot}, without damping. `theta` in radians.
   * @returns The angle that the limits allow, radians.
   */
  turnBy(theta: number): number {
    const before = this.#goal.theta;
    const isStill = !this.moving;
    if (this.#pivot === 'eye') this.lookBy(theta, 0);
    else this.setGoal({ theta: before + theta });
    const turned = this.#goal.theta - before;
    const from = this.#onCourse(this.#now);
    this.#now = isStill ? this.#goal : this.#offCourse({ ...from, theta: from.theta + turned });
    return turned;
  }

  /** Rotates the view of the goal around its own eye. Angles in radians. */
  lookBy(theta: number, phi: number): void {
    const [x, y, z] = eyeOfPose(this.#goal);
    this.setGoal({ theta: this.#goal.theta + theta, phi: this.#goal.phi + phi });
    this.setGoal(withTargetAhead({ ...this.#goal, x, y, z }));
  }

  /** Walks: moves the eye of the goal to a point in viewer space, without a change of direction. */
  setEye([x, y, z]: Vector3): void {
    this.eyeIsFree = true;
    this.setGoal(withTargetAhead({ ...this.#goal, x, y, z }));
  }

  /** Moves eye and target of the goal equally along the camera's own axes, world units. */
  moveBy(right: number, up: number, forward: number): void {
    const goal = this.#goal;
    const axes = orbitAxes(goal.theta, goal.phi);
    const along = (axis: 0 | 1 | 2): number =>
      right * axes.right[axis] + up * axes.up[axis] - forward * axes.backward[axis];
    this.setGoal({ x: goal.x + along(0), y: goal.y + along(1), z: goal.z + along(2) });
  }

  /** Rotates the goal around its target. Angles in radians. */
  orbitBy(theta: number, phi: number): void {
    this.setGoal({ theta: this.#goal.theta + theta, phi: this.#goal.phi + phi });
  }

  /** Multiplies the distance of the goal to its target by a factor, within the limits. */
  zoomBy(factor: number): void {
    this.setGoal({ radius: this.#goal.radius * factor });
  }

  /**
   * Moves eye and target of the goal in the image plane.
   * @param right Motion of the camera to its right, as a fraction of the frame's height.
   * @param up Motion of the camera upwards, as a fraction of the frame's height.
   */
  panBy(right: number, up: number): void {
    const goal = this.#goal;
    const height = 2 * goal.radius * Math.tan(goal.fieldOfView / 2);
    this.moveBy(height * right, height * up, 0);
  }
}

/** Converts a pose whose position is that of its eye to one with the position of its target. */
function withTargetAhead(pose: CameraPose): CameraPose {
  const { backward } = orbitAxes(pose.theta, pose.phi);
  const [x, y, z] = PLACE.map((key, axis) => pose[key] - pose.radius * backward[axis]);
  return { ...pose, x, y, z };
}
