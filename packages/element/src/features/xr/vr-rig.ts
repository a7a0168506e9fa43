import { multiply, subtract, type Vector3 } from '@gaussian-splat/core';
import { floorAt, type FloorMap } from '@gaussian-splat/formats/floor';
import { FloorBody } from '../../floor/floor-body.js';
import type { XrFrame, XrInput, XrPose, XrSpace } from './webxr.js';

/** Assumed height of the eyes above the floor, meters. */
const EYE_HEIGHT = 1.6;
/** Angle of one snap turn, radians. */
const TURN = Math.PI / 6;
/** Deflection of a stick, 0..1, below which it is ignored, and deflection above which it causes a snap turn. */
const [DEAD_ZONE, TURN_ZONE] = [0.2, 0.7];
/** Indices of a controller's buttons in the mapping `xr-standard`. */
const [TRIGGER, SQUEEZE] = [0, 1];
/** Maximum distance of a teleport, and length of the steps along its ray, meters. */
const [REACH, RAY_STEP] = [12, 0.05];
/** Minimum and maximum size of the scene, as a factor of its true size. */
const [MIN_SCALE, MAX_SCALE] = [0.05, 20];
/** Horizontal distance of the head from the body, meters, above which the body moves under the head. */
const STRAYED = 0.05;

/**
 * State of an input in the previous frame: `turn` is pressed, `trigger` aims, and `target` is the place on the floor
 * that it aims at.
 */
interface Held {
  input: XrInput;
  turn: boolean;
  trigger: boolean;
  target: Vector3 | undefined;
}

export interface VrStart {
  /** Position of the page's camera in viewer space, meters. */
  readonly eye: Vector3;
  /** Azimuth of the viewing direction, radians. */
  readonly heading: number;
  /** Transform from scene coordinates to viewer space in meters, 4x4, row-major. */
  readonly toViewer: Float64Array;
  /** Whether the space's origin is on the floor instead of at the eyes. */
  readonly isFloor: boolean;
  /**
   * Whether smooth motion by the stick is off, for users who prefer reduced motion. Snap turns and teleports remain.
   */
  readonly stepsOnly: boolean;
}

/**
 * Pose and size of a headset's user in the scene, changed by snap turns, motion on the floor, teleports, and both grips.
 */
export class VrRig {
  readonly #start: VrStart;
  #held = new Map<string, Held>();
  /** Inputs without a trigger button, such as hands, that are selecting. */
  readonly #selecting = new Set<XrInput>();
  /** Pose of the head in the last frame. */
  #pose: XrPose | undefined;
  #heading: number;
  /** Size of the scene, as a factor of its true size. */
  #scale = 1;
  /** Positions of both controllers in the session's space, meters, while both grip buttons are pressed. */
  #grips: readonly [Vector3, Vector3] | undefined;
  /** Position of the session space's origin in viewer space, meters; undefined before the first pose. */
  #origin: Vector3 | undefined;
  #map: FloorMap | undefined;
  #body: FloorBody | undefined;
  /** Destination of a teleport, viewer space in meters; undefined if the user does not aim at the floor. */
  target: Vector3 | undefined;

  constructor(start: VrStart) {
    this.#start = start;
    this.#heading = start.heading;
  }

  /** Sets the map of the floor when it is loaded. */
  set map(map: FloorMap) {
    this.#map = map;
    if (!this.#pose) return;
    // Visitors may have moved before the map is loaded. Over no floor, such as outside a house, they would walk through walls.
    const body = this.#bodyUnder(this.#headAt(this.#pose));
    if (!body) {
      this.#jump(map.start, this.#pose);
      return;
    }
    const [x, , z] = this.#origin!;
    this.#origin = [x, this.#floorY(body.at[1]), z];
  }

  /** Starts to aim with an input that has no trigger button, at its event `selectstart`. */
  aim(input: XrInput): void {
    this.#selecting.add(input);
  }

  /**
   * Teleports to the place that such an input aimed at in the last frame, at its event `selectend`.
   * @param isGesture Whether the pinch was part of a gesture of both hands, which aims at nothing.
   */
  choose(input: XrInput, isGesture = false): void {
    const held = [...this.#held.values()].find((each) => each.input === input);
    if (!this.#selecting.delete(input) || !held || hasTrigger(input)) return;
    if (held.target && this.#pose && !isGesture) this.#jump(held.target, this.#pose);
    held.trigger = false;
  }

  /**
   * Advances the pose to a frame.
   * @param seconds Time since the previous frame.
   * @returns the transform from scene coordinates to the session's space, 4x4, row-major
   */
  place(frame: XrFrame, pose: XrPose, space: XrSpace, seconds: number): Float64Array {
    const { x, z } = pose.transform.position;
    this.#pose = pose;
    this.#origin ??= this.#begin(x, z);
    this.target = undefined;
    const before = this.#held;
    // The state of an input that has vanished is dropped, so that its return with another state is no press or release.
    this.#held = new Map();
    [...frame.session.inputSources].forEach((input, i) => {
      const key = `${i} ${input.handedness}`;
      const known = before.get(key) ?? { turn: false, trigger: false, target: undefined };
      const held = { ...known, input };
      this.#held.set(key, held);
      this.#read(frame, space, pose, held, seconds);
    });
    this.#grip(frame, space);
    return this.#matrix();
  }

  /** Position of the head in the last frame, viewer space in meters; undefined before the first frame. */
  get head(): Vector3 | undefined {
    return this.#pose && this.#headAt(this.#pose);
  }

  /** Destination of a teleport in the session's space, meters; undefined without one. */
  get targetInSpace(): Vector3 | undefined {
    if (!this.target) return undefined;
    const [x, y, z] = [0, 1, 2].map((k) => this.#scale * (this.target![k] - this.#origin![k]));
    const [sin, cos] = [Math.sin(this.#heading), Math.cos(this.#heading)];
    return [cos * x - sin * z, y, sin * x + cos * z];
  }

  #begin(x: number, z: number): Vector3 {
    const { eye, isFloor } = this.#start;
    const head = this.#turned([x, 0, z]);
    if (this.#map) this.#body = new FloorBody(this.#map, eye);
    const below = this.#body ? this.#body.at : undefined;
    const y = below ? this.#floorY(below[1]) : isFloor ? eye[1] - EYE_HEIGHT : eye[1];
    const [atX, atZ] = below ? [below[0], below[2]] : [eye[0], eye[2]];
    return [atX - head[0], y, atZ - head[2]];
  }

  #floorY(floor: number): number {
    return this.#start.isFloor ? floor : floor + EYE_HEIGHT / this.#scale;
  }

  /** Converts a vector from the session's space to viewer space. */
  #turned([x, y, z]: Vector3): Vector3 {
    const [sin, cos] = [Math.sin(this.#heading) / this.#scale, Math.cos(this.#heading) / this.#scale];
    return [cos * x + sin * z, y / this.#scale, -sin * x + cos * z];
  }

  #matrix(): Float64Array {
    const scale = this.#scale;
    const [sin, cos] = [scale * Math.sin(this.#heading), scale * Math.cos(this.#heading)];
    const [x, y, z] = this.#origin!;
    const turn = [cos, 0, -sin, 0, 0, scale, 0, 0, sin, 0, cos, 0, 0, 0, 0, 1];
    const move = [1, 0, 0, -x, 0, 1, 0, -y, 0, 0, 1, -z, 0, 0, 0, 1];
    return Float64Array.from(multiply(multiply(turn, move), this.#start.toViewer));
  }

  #read(frame: XrFrame, space: XrSpace, pose: XrPose, held: Held, seconds: number): void {
    const { gamepad: pad, handedness } = held.input;
    this.#aim(frame, space, pose, held);
    if (!pad) return;
    const [x, y] = [pad.axes[2] ?? pad.axes[0] ?? 0, pad.axes[3] ?? pad.axes[1] ?? 0];
    if (handedness === 'left') this.#stride(x, y, pose, seconds);
    else this.#turnBy(x, pose, held);
  }

  /**
   * Moves, turns and scales the scene with both controllers while their grip buttons are pressed, so that the points
   * under them stay there. The scene stays upright.
   */
  #grip(frame: XrFrame, space: XrSpace): void {
    const [a, b] = [...this.#held.values()].flatMap(({ input }): Vector3[] => {
      const isHeld = !this.#start.stepsOnly && input.gamepad?.buttons[SQUEEZE]?.pressed;
      const m = isHeld && frame.getPose(input.gripSpace ?? input.targetRaySpace, space)?.transform.matrix;
      return m ? [[m[12], m[13], m[14]]] : [];
    });
    const before = this.#grips;
    this.#grips = a && b && [a, b];
    if (!before || !b) return;
    const held = this.#viewerOf(middle(...before));
    const [from, to] = [subtract(before[1], before[0]), subtract(b, a)];
    const factor = Math.hypot(...to) / Math.max(1e-3, Math.hypot(...from));
    this.#scale = Math.min(MAX_SCALE, Math.max(MIN_SCALE, this.#scale * factor));
    this.#heading += Math.atan2(from[0], from[2]) - Math.atan2(to[0], to[2]);
    this.#origin = subtract(held, this.#turned(middle(a, b)));
  }

  /** Converts a point from the session's space to viewer space, meters. */
  #viewerOf(point: Vector3): Vector3 {
    const from = this.#turned(point);
    return [0, 1, 2].map((k) => this.#origin![k] + from[k]) as unknown as Vector3;
  }

  /** Returns the position of the head in viewer space, meters. */
  #headAt({ transform: { position } }: XrPose): Vector3 {
    return this.#viewerOf([position.x, position.y, position.z]);
  }

  /** Turns the user around the head if a stick is deflected to a side, once per deflection. */
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

  /**
   * Moves the user along the floor, relative to the direction of the head. `x` and `y` are the deflection of the stick,
   * -1..1.
   */
  #stride(x: number, y: number, pose: XrPose, seconds: number): void {
    if (this.#start.stepsOnly || seconds === 0) return;
    if (Math.hypot(x, y) < DEAD_ZONE) return this.#settle(seconds);
    const m = pose.transform.matrix;
    const ahead = this.#turned([-m[8], 0, -m[10]]);
    const length = Math.hypot(ahead[0], ahead[2]) || 1;
    const [aheadX, aheadZ] = [ahead[0] / length, ahead[2] / length];
    const [dx, dz] = [-aheadZ * x - aheadX * y, aheadX * x - aheadZ * y];
    const origin = this.#origin!;
    // Visitors also move by steps of their own.
    const body = this.#bodyUnder(this.#headAt(pose));
    // The speed is that of the body, not of the scaled scene.
    const time = seconds / this.#scale;
    if (!body) {
      const way = 1.4 * time;
      this.#origin = [origin[0] + way * dx, origin[1], origin[2] + way * dz];
      return;
    }
    const before = body.at;
    body.step(time, dx, dz);
    const { at, eyeFloor } = body;
    this.#origin = [origin[0] + at[0] - before[0], this.#floorY(eyeFloor), origin[2] + at[2] - before[2]];
  }

  /** Moves the eyes on to their height above the floor, which they may not have reached when the stick came to rest. */
  #settle(seconds: number): void {
    const body = this.#body;
    if (!body?.isMoving) return;
    body.step(seconds / this.#scale, 0, 0);
    const [x, , z] = this.#origin!;
    this.#origin = [x, this.#floorY(body.eyeFloor), z];
  }

  /**
   * Returns the body, which moves under the head if there is a floor. Undefined without a map, and while the head has
   * been over no floor yet.
   */
  #bodyUnder(head: Vector3): FloorBody | undefined {
    const isUnder = ({ at }: FloorBody): boolean => Math.hypot(head[0] - at[0], head[2] - at[2]) <= STRAYED;
    if (!this.#body && this.#map) {
      const body = new FloorBody(this.#map, head);
      if (isUnder(body)) this.#body = body;
    } else if (this.#body && !isUnder(this.#body)) this.#body.land(head);
    return this.#body;
  }

  /** Aims while the trigger is held or the stick is pushed forward, and teleports when they are released. */
  #aim(frame: XrFrame, space: XrSpace, pose: XrPose, held: Held): void {
    const { input } = held;
    const isPressed = input.gamepad?.buttons[TRIGGER]?.pressed ?? this.#selecting.has(input);
    const isHeld = isPressed || this.#isPushed(held);
    const ray = isHeld || held.trigger ? frame.getPose(input.targetRaySpace, space) : undefined;
    held.target = ray ? this.#hit(ray) : undefined;
    if (isHeld) this.target = held.target ?? this.target;
    else if (held.trigger && held.target) this.#jump(held.target, pose);
    held.trigger = isHeld;
  }

  /** Whether a stick is pushed forward that does not walk: then it aims until it is back in its middle. */
  #isPushed({ input: { gamepad, handedness }, trigger }: Held): boolean {
    if (!gamepad || (handedness === 'left' && !this.#start.stepsOnly)) return false;
    const [x, y] = [gamepad.axes[2] ?? gamepad.axes[0] ?? 0, gamepad.axes[3] ?? gamepad.axes[1] ?? 0];
    return trigger ? y < -DEAD_ZONE : y < -TURN_ZONE && -y > Math.abs(x);
  }

  #jump(to: Vector3, pose: XrPose): void {
    const head = this.#headAt(pose);
    const origin = this.#origin!;
    this.#origin = [origin[0] + to[0] - head[0], this.#floorY(to[1]), origin[2] + to[2] - head[2]];
    if (this.#map) this.#body = new FloorBody(this.#map, to);
  }

  /**
   * Returns the point where a ray meets the floor, viewer space in meters; undefined if it does not within the maximum
   * distance.
   */
  #hit({ transform: { matrix: m } }: XrPose): Vector3 | undefined {
    const from = this.#turned([m[12], m[13], m[14]]);
    const way = this.#turned([-m[8], -m[9], -m[10]]);
    const origin = this.#origin!;
    // A step in a reduced scene must not be longer than the range of heights that `floorAt` accepts.
    const step = RAY_STEP * Math.min(1, this.#scale);
    for (let far = step; far < REACH; far += step) {
      const [x, y, z] = [0, 1, 2].map((k) => origin[k] + from[k] + far * way[k]);
      const floor = this.#map ? floorAt(this.#map, x, z, y) : 2 * origin[1] - this.#floorY(origin[1]);
      if (floor !== undefined && y <= floor) return [x, floor, z];
    }
    return undefined;
  }
}

const hasTrigger = ({ gamepad }: XrInput): boolean => gamepad?.buttons[TRIGGER] !== undefined;

const middle = (a: Vector3, b: Vector3): Vector3 => [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2, (a[2] + b[2]) / 2];
