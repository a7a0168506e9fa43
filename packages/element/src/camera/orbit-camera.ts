import type { Vector3 } from '@gaussian-splat/core';
import { Damper } from './damper.js';
import { eyeOfPose, orbitAxes, type CameraPose } from './orbit.js';

/** Fixed point of a motion: the target that the camera orbits, or the eye of a flying camera. */
export type Pivot = 'target' | 'eye';

/** Lower and upper limit of each component of a pose. */
export interface CameraLimits {
  readonly min: CameraPose;
  readonly max: CameraPose;
}

const KEYS = ['theta', 'phi', 'radius', 'x', 'y', 'z', 'fieldOfView'] as const;
/** Components of a pose for its position; the others define the view from there. */
const PLACE = ['x', 'y', 'z'] as const;
const everywhere = (value: number): CameraPose => ({
  theta: value,
  phi: value,
  radius: value,
  x: value,
  y: value,
  z: value,
  fieldOfView: value,
});

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

  constructor(pose: CameraPose) {
    this.#now = pose;
    this.#goal = pose;
  }

  /** The current pose. */
  get now(): CameraPose {
    return this.#now;
  }

  /** The goal; equal to {@link now} at rest. */
  get goal(): CameraPose {
    return this.#goal;
  }

  /** Whether {@link step} still has something to do. */
  get moving(): boolean {
    return KEYS.some((key) => this.#now[key] !== this.#goal[key]);
  }

  get pivot(): Pivot {
    return this.#pivot;
  }

  /** The pivot `eye` keeps the position of a camera that looks around, also on the way to its goal. */
  set pivot(pivot: Pivot) {
    if (pivot === this.#pivot) return;
    this.#pivot = pivot;
    // Their velocities belong to another point.
    for (const damper of this.#dampers) damper.stop();
  }

  /** Limits of all further goals; the current goal is clamped to them. */
  set limits(limits: CameraLimits) {
    this.#limits = limits;
    this.setGoal({});
  }

  /** Changes components of the goal, within the limits. */
  setGoal(changes: Partial<CameraPose>): void {
    const { min, max } = this.#limits;
    const wanted = { ...this.#goal, ...changes };
    const goal = { ...wanted };
    for (const key of KEYS) goal[key] = Math.min(max[key], Math.max(min[key], wanted[key]));
    this.#goal = goal;
  }

  /** Removes full turns from the current azimuth, so that the path to the goal is the short one. */
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
   * @param stepMs Time since the last step, milliseconds.
   * @param decayMs Time constant of the motion, milliseconds; 0 jumps.
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
    // At its end the motion is exactly at the goal, without the rounding error of converting through the eye.
    this.#now = KEYS.every((key) => now[key] === to[key]) ? this.#goal : this.#offCourse(now);
    return true;
  }

  /** The pose with the position that keeps the pivot fixed. */
  #onCourse(pose: CameraPose): CameraPose {
    if (this.#pivot === 'target') return pose;
    const [x, y, z] = eyeOfPose(pose);
    return { ...pose, x, y, z };
  }

  #offCourse(pose: CameraPose): CameraPose {
    return this.#pivot === 'target' ? pose : withTargetAhead(pose);
  }

  /**
   * Rotates camera and goal equally around the {@link pivot}, without damping: radians. @returns The angle within the
   * limits.
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

  /** Rotates the goal's view around its own eye by angles in radians. */
  lookBy(theta: number, phi: number): void {
    const [x, y, z] = eyeOfPose(this.#goal);
    this.setGoal({ theta: this.#goal.theta + theta, phi: this.#goal.phi + phi });
    this.setGoal(withTargetAhead({ ...this.#goal, x, y, z }));
  }

  /** Moves the goal's eye to a point; the direction does not change. */
  setEye([x, y, z]: Vector3): void {
    this.setGoal(withTargetAhead({ ...this.#goal, x, y, z }));
  }

  /** Moves the goal along its own axes, eye and target equally: world units. */
  moveBy(right: number, up: number, forward: number): void {
    const goal = this.#goal;
    const axes = orbitAxes(goal.theta, goal.phi);
    const along = (axis: 0 | 1 | 2): number =>
      right * axes.right[axis] + up * axes.up[axis] - forward * axes.backward[axis];
    this.setGoal({ x: goal.x + along(0), y: goal.y + along(1), z: goal.z + along(2) });
  }

  /** Rotates the goal around its target by angles in radians. */
  orbitBy(theta: number, phi: number): void {
    this.setGoal({ theta: this.#goal.theta + theta, phi: this.#goal.phi + phi });
  }

  /** Multiplies the distance to the target. */
  zoomBy(factor: number): void {
    this.setGoal({ radius: this.#goal.radius * factor });
  }

  /**
   * Moves the target in the image plane.
   * @param right Motion of the camera to its right, as a fraction of the frame's height.
   * @param up The same, upwards.
   */
  panBy(right: number, up: number): void {
    const goal = this.#goal;
    const height = 2 * goal.radius * Math.tan(goal.fieldOfView / 2);
    this.moveBy(height * right, height * up, 0);
  }
}

/** Converts a pose with the position of its eye to one with that of its target. */
function withTargetAhead(pose: CameraPose): CameraPose {
  const { backward } = orbitAxes(pose.theta, pose.phi);
  const [x, y, z] = PLACE.map((key, axis) => pose[key] - pose.radius * backward[axis]);
  return { ...pose, x, y, z };
}
