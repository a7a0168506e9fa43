import type { Vector3 } from '@gaussian-splat/core';
import { Damper } from './damper.js';
import { eyeOfPose, orbitAxes, type CameraPose } from './orbit.js';

/** What a motion keeps on course: the target that the camera turns around, or the eye of one that flies. */
export type Pivot = 'target' | 'eye';

/** Smallest and largest value that each part of a pose may take. */
export interface CameraLimits {
  readonly min: CameraPose;
  readonly max: CameraPose;
}

const KEYS = ['theta', 'phi', 'radius', 'x', 'y', 'z', 'fieldOfView'] as const;
/** The parts of a pose that say where it is; the others say how it looks from there. */
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
 * A camera that turns around a target: where it is now, where it is going, and the damped way between.
 * Knows no page, no attribute and no scene.
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

  /** Where the camera is. */
  get now(): CameraPose {
    return this.#now;
  }

  /** Where it is going; the same values as {@link now} when it stands still. */
  get goal(): CameraPose {
    return this.#goal;
  }

  /** True while {@link step} still has something to do. */
  get moving(): boolean {
    return KEYS.some((key) => this.#now[key] !== this.#goal[key]);
  }

  get pivot(): Pivot {
    return this.#pivot;
  }

  /** With `eye` a camera that looks around stays where it is also on the way to its goal. */
  set pivot(pivot: Pivot) {
    if (pivot === this.#pivot) return;
    this.#pivot = pivot;
    // Their velocities were those of another point.
    for (const damper of this.#dampers) damper.stop();
  }

  /** Bounds of every goal from now on; the present goal is brought within them. */
  set limits(limits: CameraLimits) {
    this.#limits = limits;
    this.setGoal({});
  }

  /** Changes parts of the goal, within the limits. */
  setGoal(changes: Partial<CameraPose>): void {
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
    const from = this.#onCourse(this.#now);
    const to = this.#onCourse(this.#goal);
    const now = { ...from };
    KEYS.forEach((key, i) => {
      const scale = key === 'theta' || key === 'phi' || key === 'fieldOfView' ? 1 : to.radius;
      now[key] = this.#dampers[i].step(from[key], to[key], stepMs, decayMs, scale);
    });
    // At its end the motion is exactly at the goal: the way there and back through the eye would leave a rounding.
    this.#now = KEYS.every((key) => now[key] === to[key]) ? this.#goal : this.#offCourse(now);
    return true;
  }

  /** The pose with the place of what is kept on course. */
  #onCourse(pose: CameraPose): CameraPose {
    if (this.#pivot === 'target') return pose;
    const [x, y, z] = eyeOfPose(pose);
    return { ...pose, x, y, z };
  }

  #offCourse(pose: CameraPose): CameraPose {
    return this.#pivot === 'target' ? pose : withTargetAhead(pose);
  }

  /** Turns camera and goal alike around the {@link pivot}, without any damping: radians. @returns how far the limits let them */
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

  /** Turns the goal's view around its own eye by angles in radians. */
  lookBy(theta: number, phi: number): void {
    const [x, y, z] = eyeOfPose(this.#goal);
    this.setGoal({ theta: this.#goal.theta + theta, phi: this.#goal.phi + phi });
    this.setGoal(withTargetAhead({ ...this.#goal, x, y, z }));
  }

  /** Puts the goal's eye at a point; it looks where it looked. */
  setEye([x, y, z]: Vector3): void {
    this.setGoal(withTargetAhead({ ...this.#goal, x, y, z }));
  }

  /** Moves the goal along its own axes, eye and target alike: world units. */
  moveBy(right: number, up: number, forward: number): void {
    const goal = this.#goal;
    const axes = orbitAxes(goal.theta, goal.phi);
    const along = (axis: 0 | 1 | 2): number =>
      right * axes.right[axis] + up * axes.up[axis] - forward * axes.backward[axis];
    this.setGoal({ x: goal.x + along(0), y: goal.y + along(1), z: goal.z + along(2) });
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
    this.moveBy(height * right, height * up, 0);
  }
}

/** A pose whose place is that of its eye, with that of its target instead. */
function withTargetAhead(pose: CameraPose): CameraPose {
  const { backward } = orbitAxes(pose.theta, pose.phi);
  const [x, y, z] = PLACE.map((key, axis) => pose[key] - pose.radius * backward[axis]);
  return { ...pose, x, y, z };
}
