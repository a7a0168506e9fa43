import { multiply, type Vector3 } from '@gaussian-splat/core';
import { floorAt, type WalkMap } from '@gaussian-splat/formats/walk';
import { Walker } from '../walk/walker.js';
import type { XrFrame, XrInput, XrPose, XrSpace } from './webxr.js';

/** Assumed height of the eyes above the floor, meters. */
const EYE_HEIGHT = 1.6;
/** Angle of a turn by the stick, radians. */
const TURN = Math.PI / 6;
/** Deflection of a stick below which it is ignored, and above which it turns. */
const [DEAD_ZONE, TURN_ZONE] = [0.2, 0.7];
/** Buttons of a controller, as `xr-standard` numbers them. */
const [TRIGGER, LEAVE] = [0, 5];
/** Time that the exit button must be held, seconds. */
const LEAVE_SECONDS = 1;
/** Maximum distance of a teleport, and step size along its ray, meters. */
const [REACH, RAY_STEP] = [12, 0.05];

/** State of a stick and of buttons in the previous frame. */
interface Held {
  turn: boolean;
  trigger: boolean;
  leave: number;
}

export interface VrStart {
  /** Position of the camera's eye, meters, viewer space. */
  readonly eye: Vector3;
  /** Viewing direction around the vertical axis, radians. */
  readonly heading: number;
  /** The scene's frame to viewer space, scaled to meters, row-major. */
  readonly toViewer: Float64Array;
  /** Whether the space's origin is on the floor instead of at the eyes. */
  readonly isFloor: boolean;
  /** Smooth locomotion is off. */
  readonly stepsOnly: boolean;
}

/** Pose of a headset's user in the scene: snap turns, walking on the floor, and teleports. */
export class VrRig {
  readonly #start: VrStart;
  readonly #onLeave: () => void;
  readonly #held = new Map<string, Held>();
  #heading: number;
  /** Position of the space's origin, viewer space, meters; undefined before the first pose. */
  #origin: Vector3 | undefined;
  #map: WalkMap | undefined;
  #walker: Walker | undefined;
  /** Destination of a teleport while aiming. */
  target: Vector3 | undefined;

  constructor(start: VrStart, onLeave: () => void) {
    this.#start = start;
    this.#onLeave = onLeave;
    this.#heading = start.heading;
  }

  /** Sets the floor once it is loaded. */
  set map(map: WalkMap) {
    this.#map = map;
    if (this.#origin) this.#walker = new Walker(map, this.#start.eye);
    if (this.#walker && this.#origin)
      this.#origin = [this.#origin[0], this.#floorY(this.#walker.at[1]), this.#origin[2]];
  }

  /** Advances to a frame. @returns the scene's frame to the space, row-major */
  place(frame: XrFrame, pose: XrPose, space: XrSpace, seconds: number): Float64Array {
    const { x, z } = pose.transform.position;
    this.#origin ??= this.#begin(x, z);
    this.target = undefined;
    for (const input of frame.session.inputSources) this.#read(frame, space, pose, input, seconds);
    return this.#matrix();
  }

  /** The destination in the session's space. */
  get targetInSpace(): Vector3 | undefined {
    if (!this.target) return undefined;
    const [x, y, z] = [0, 1, 2].map((k) => this.target![k] - this.#origin![k]);
    const [sin, cos] = [Math.sin(this.#heading), Math.cos(this.#heading)];
    return [cos * x - sin * z, y, sin * x + cos * z];
  }

  #begin(x: number, z: number): Vector3 {
    const { eye, isFloor } = this.#start;
    const head = this.#turned([x, 0, z]);
    if (this.#map) this.#walker = new Walker(this.#map, eye);
    const below = this.#walker ? this.#walker.at : undefined;
    const y = below ? this.#floorY(below[1]) : isFloor ? eye[1] - EYE_HEIGHT : eye[1];
    const [atX, atZ] = below ? [below[0], below[2]] : [eye[0], eye[2]];
    return [atX - head[0], y, atZ - head[2]];
  }

  #floorY(floor: number): number {
    return this.#start.isFloor ? floor : floor + EYE_HEIGHT;
  }

  /** Direction from the session's space to viewer space. */
  #turned([x, y, z]: Vector3): Vector3 {
    const [sin, cos] = [Math.sin(this.#heading), Math.cos(this.#heading)];
    return [cos * x + sin * z, y, -sin * x + cos * z];
  }

  #matrix(): Float64Array {
    const [sin, cos] = [Math.sin(this.#heading), Math.cos(this.#heading)];
    const [x, y, z] = this.#origin!;
    const turn = [cos, 0, -sin, 0, 0, 1, 0, 0, sin, 0, cos, 0, 0, 0, 0, 1];
    const move = [1, 0, 0, -x, 0, 1, 0, -y, 0, 0, 1, -z, 0, 0, 0, 1];
    return Float64Array.from(multiply(multiply(turn, move), this.#start.toViewer));
  }

  #read(frame: XrFrame, space: XrSpace, pose: XrPose, input: XrInput, seconds: number): void {
    const pad = input.gamepad;
    if (!pad) return;
    const held = this.#held.get(input.handedness) ?? { turn: false, trigger: false, leave: 0 };
    this.#held.set(input.handedness, held);
    const [x, y] = [pad.axes[2] ?? pad.axes[0] ?? 0, pad.axes[3] ?? pad.axes[1] ?? 0];
    if (input.handedness === 'left') this.#walk(x, y, pose, seconds);
    else this.#turnBy(x, pose, held);
    this.#aim(frame, space, pose, input, held);
    held.leave = pad.buttons[LEAVE]?.pressed ? held.leave + seconds : 0;
    if (held.leave >= LEAVE_SECONDS) {
      held.leave = 0;
      this.#onLeave();
    }
  }

  /** Position of the head, viewer space. */
  #headAt({ transform: { position } }: XrPose): Vector3 {
    const head = this.#turned([position.x, position.y, position.z]);
    return [0, 1, 2].map((k) => this.#origin![k] + head[k]) as unknown as Vector3;
  }

  /** Snap turns rotate around the head. */
  #turnBy(x: number, pose: XrPose, held: Held): void {
    const isTurning = Math.abs(x) > TURN_ZONE;
    if (isTurning && !held.turn) {
      const before = this.#headAt(pose);
      this.#heading -= Math.sign(x) * TURN;
      const after = this.#headAt(pose);
      this.#origin = [0, 1, 2].map((k) => this.#origin![k] + before[k] - after[k]) as unknown as Vector3;
    }
    held.turn = isTurning;
  }

  /** Motion along the floor in the direction of the head. */
  #walk(x: number, y: number, pose: XrPose, seconds: number): void {
    if (this.#start.stepsOnly || Math.hypot(x, y) < DEAD_ZONE || seconds === 0) return;
    const m = pose.transform.matrix;
    const ahead = this.#turned([-m[8], 0, -m[10]]);
    const length = Math.hypot(ahead[0], ahead[2]) || 1;
    const [aheadX, aheadZ] = [ahead[0] / length, ahead[2] / length];
    const [dx, dz] = [-aheadZ * x - aheadX * y, aheadX * x - aheadZ * y];
    const origin = this.#origin!;
    const walker = this.#walker;
    if (!walker) {
      const way = 1.4 * seconds;
      this.#origin = [origin[0] + way * dx, origin[1], origin[2] + way * dz];
      return;
    }
    const before = walker.at;
    walker.step(seconds, dx, dz);
    const { at, eyeFloor } = walker;
    this.#origin = [origin[0] + at[0] - before[0], this.#floorY(eyeFloor), origin[2] + at[2] - before[2]];
  }

  /** Holding the trigger aims; releasing it teleports. */
  #aim(frame: XrFrame, space: XrSpace, pose: XrPose, input: XrInput, held: Held): void {
    const isHeld = input.gamepad?.buttons[TRIGGER]?.pressed ?? false;
    const ray = isHeld || held.trigger ? frame.getPose(input.targetRaySpace, space) : undefined;
    const target = ray ? this.#hit(ray) : undefined;
    if (isHeld) this.target = target ?? this.target;
    if (held.trigger && !isHeld && target) this.#jump(target, pose);
    held.trigger = isHeld;
  }

  #jump(to: Vector3, pose: XrPose): void {
    const head = this.#headAt(pose);
    const origin = this.#origin!;
    this.#origin = [origin[0] + to[0] - head[0], this.#floorY(to[1]), origin[2] + to[2] - head[2]];
    if (this.#map) this.#walker = new Walker(this.#map, [to[0], to[1] + EYE_HEIGHT, to[2]]);
  }

  /** Only a ray that meets the floor has a valid destination. */
  #hit({ transform: { matrix: m } }: XrPose): Vector3 | undefined {
    const from = this.#turned([m[12], m[13], m[14]]);
    const way = this.#turned([-m[8], -m[9], -m[10]]);
    const origin = this.#origin!;
    for (let far = RAY_STEP; far < REACH; far += RAY_STEP) {
      const [x, y, z] = [0, 1, 2].map((k) => origin[k] + from[k] + far * way[k]);
      const floor = this.#map ? floorAt(this.#map, x, z, y) : origin[1] - (this.#start.isFloor ? 0 : EYE_HEIGHT);
      if (floor !== undefined && y <= floor) return [x, floor, z];
    }
    return undefined;
  }
}
