import { subtract, type Camera, type Vector3 } from '@gaussian-splat/core';
import {
  cameraOfPose,
  framingDistance,
  nearPlane,
  parallelCamera,
  toViewer,
  type CameraPose,
  type ViewerFrame,
} from './camera/orbit.js';
import { OrbitCamera, type Pivot } from './camera/orbit-camera.js';
import { frameOf, limitsOf, poseOf, type CameraSettings, type SceneBounds } from './camera/settings.js';
import { CameraOrbit, CameraTarget, FieldOfView } from './camera/values.js';
import type { CameraAction } from './camera/gestures.js';
import type { CameraChangeSource } from './events.js';
import type { ViewContext } from './camera/camera-view.js';

/**
 * Returns the bounds with the center and the radius that the camera frames: those of an isolated subject, otherwise
 * those of the scene.
 */
const framed = (bounds: SceneBounds): SceneBounds => ({ ...bounds, ...bounds.subject });

/** Bounds that are assumed before any scene is loaded. */
const UNKNOWN_BOUNDS: SceneBounds = { min: [-1, -1, -1], max: [1, 1, 1], center: [0, 0, 0], radius: 1 };
/** Longest step of the damped motion, ms. After a pause the camera therefore continues near its last pose. */
const MAX_STEP_MS = 100;
/** Duration of the first step of a motion after a rest, ms. */
const FIRST_STEP_MS = 1000 / 60;

/**
 * The element's camera. It combines the attributes, the bounds of the scene and the aspect ratio of the frame into a
 * pose for each time.
 */
export class CameraController {
  readonly #camera: OrbitCamera;
  readonly #onChange: () => void;
  #settings: CameraSettings;
  #bounds = UNKNOWN_BOUNDS;
  #aspect = 1;
  #source: CameraChangeSource = 'none';
  /** Whether a visitor has changed the distance since the attributes set it; a new aspect ratio then keeps it. */
  #userDistance = false;
  /** Whether a visitor or a flight has moved the camera since a scene was framed or the camera was reset. */
  #isTouched = false;
  /** Whether automatic rotation has moved the camera since a scene was framed. */
  #isTurned = false;
  #jumped = false;
  /** Pose of the last flight; automatic limits are extended to include it. */
  #asked: CameraPose | undefined;
  #lastStep: number | undefined;

  /** @param onChange Called when the camera differs from that of the last frame. */
  constructor(settings: CameraSettings, onChange: () => void) {
    this.#settings = settings;
    this.#onChange = onChange;
    this.#camera = new OrbitCamera(poseOf(settings, UNKNOWN_BOUNDS, 1));
    this.#limit();
  }

  get orbit(): CameraOrbit {
    const { theta, phi, radius, fieldOfView } = this.#camera.now;
    return new CameraOrbit(theta, phi, radius, framingDistance(this.#bounds.radius, fieldOfView, this.#aspect));
  }

  get target(): CameraTarget {
    const { x, y, z } = this.#camera.now;
    return new CameraTarget(x, y, z);
  }

  get fieldOfView(): FieldOfView {
    return new FieldOfView(this.#camera.now.fieldOfView);
  }

  /** Rotation from scene coordinates to viewer space, the coordinates of orbit and target. */
  get viewerFrame(): ViewerFrame {
    return frameOf(this.#settings, this.#bounds);
  }

  /**
   * The framed bounds, in scene coordinates. For an isolated subject, `center` and `radius` are those of the complete
   * subject.
   */
  get bounds(): SceneBounds {
    return this.#bounds;
  }

  /** Sets the fixed point of a visitor's rotation: see {@link OrbitCamera.pivot}. */
  set pivot(pivot: Pivot) {
    this.#camera.pivot = pivot;
  }

  /** Whether a visitor or a flight has moved the camera since a scene was framed or the camera was reset. */
  get isTouched(): boolean {
    return this.#isTouched;
  }

  /** The pose to which the damped motion leads. */
  get goal(): CameraPose {
    return this.#camera.goal;
  }

  /** Values from which views are parsed: relative views refer to the goal of the motion. */
  get context(): ViewContext {
    const [settings, bounds, aspect, from] = [this.#settings, this.#bounds, this.#aspect, this.#camera.goal];
    return { settings, bounds, frame: this.viewerFrame, aspect, from };
  }

  /** Moves the camera at once to a pose, within the limits of the page. A flight calls it in each frame. */
  moveTo(pose: CameraPose): void {
    this.#source = 'none';
    this.#userDistance = this.#isTouched = true;
    this.#asked = pose;
    this.#limit();
    this.#camera.setGoal(pose);
    this.jumpToGoal();
  }

  get isMoving(): boolean {
    return this.#camera.moving;
  }

  /**
   * Returns the current camera for a frame of width x height pixels: a pinhole camera, or a parallel one if the page
   * has set `orthographic` and the camera does not walk.
   */
  view(width: number, height: number): Camera {
    const { now } = this.#camera;
    const { min, max, center } = this.#bounds;
    const camera = cameraOfPose(now, this.viewerFrame, width, height, nearPlane(this.#bounds));
    if (!this.#settings.orthographic || this.#camera.eyeIsFree) return camera;
    const away = subtract(toViewer(this.viewerFrame, center), [now.x, now.y, now.z]);
    return parallelCamera(camera, now.radius, Math.hypot(...away) + Math.hypot(...subtract(max, min)));
  }

  /**
   * Applies new attributes. Attributes that have not changed keep the pose that a visitor may have chosen.
   * @param set Attributes that the page has set, even to the same value.
   */
  applySettings(settings: CameraSettings, set: ReadonlySet<keyof CameraSettings> = new Set()): void {
    const old = this.#settings;
    this.#settings = settings;
    this.#limit();
    const { theta, phi, radius, x, y, z, fieldOfView } = poseOf(settings, this.#bounds, this.#aspect);
    const changed = (key: keyof CameraSettings): boolean =>
      set.has(key) || JSON.stringify(old[key]) !== JSON.stringify(settings[key]);
    // Both determine whether the first view is within the scene.
    const isPlaced = this.#bounds.inside !== undefined && (changed('orbit') || changed('target'));
    this.#source = 'none';
    if (changed('up')) return this.#reframe('none');
    if (changed('fieldOfView')) this.#camera.setGoal({ fieldOfView });
    if (isPlaced || changed('target')) this.#camera.setGoal({ x, y, z });
    if (isPlaced || changed('orbit')) {
      this.#userDistance = false;
      this.#camera.setGoal({ theta, phi, radius });
      this.#camera.unwind();
    } else if (changed('fieldOfView') && !this.#userDistance) {
      this.#camera.setGoal({ radius });
    }
    this.#onChange();
  }

  /** Frames a new scene: sets its bounds, and moves the camera at once to the pose of the attributes. */
  frame(bounds: SceneBounds): void {
    this.#bounds = framed(bounds);
    this.#isTouched = this.#isTurned = false;
    this.#reframe('automatic');
  }

  /** Updates the bounds of the scene. The camera moves to the resulting pose, unless a visitor has moved it. */
  refine(bounds: SceneBounds): void {
    this.#bounds = framed(bounds);
    this.#limit();
    if (!this.#isTouched) {
      this.#source = 'automatic';
      const { theta, ...pose } = poseOf(this.#settings, this.#bounds, this.#aspect);
      this.#camera.setGoal(this.#isTurned ? pose : { theta, ...pose });
      if (this.#bounds.inside) this.jumpToGoal(); // A motion from the view of a preview could go through walls.
    }
    this.#onChange();
  }

  /** Applies a new aspect ratio, width / height. The camera jumps to its new distance, unless a visitor has zoomed. */
  setAspect(aspect: number): void {
    if (aspect === this.#aspect) return;
    this.#aspect = aspect;
    this.#limit();
    if (this.#userDistance) return;
    this.#camera.setGoal({ radius: poseOf(this.#settings, this.#bounds, aspect).radius });
    if (!this.#camera.moving) return;
    this.#source = 'automatic';
    this.jumpToGoal();
  }

  /** Returns the camera to the pose of the attributes. `source` is the source of the change in the next event. */
  reset(source: CameraChangeSource): void {
    this.#source = source;
    this.#userDistance = this.#isTouched = false;
    this.#asked = undefined;
    this.#limit();
    this.#camera.setGoal(poseOf(this.#settings, this.#bounds, this.#aspect));
    this.#camera.unwind();
    this.#onChange();
  }

  jumpToGoal(): void {
    this.#jumped ||= this.#camera.moving;
    this.#camera.jumpToGoal();
    this.#onChange();
  }

  /** Orbits about the target by a visitor's input: changes azimuth `theta` and polar angle `phi`, radians. */
  orbitBy(theta: number, phi: number): void {
    this.#camera.orbitBy(theta, phi);
    this.#moveByUser();
  }

  /**
   * Looks around from the current position of the camera by a visitor's input: changes azimuth and polar angle,
   * radians.
   */
  lookBy(theta: number, phi: number): void {
    this.#camera.lookBy(theta, phi);
    this.#moveByUser();
  }

  /**
   * Applies a visitor's gesture or key. With the eye as {@link pivot}, a drag by the height of the frame rotates by the
   * field of view, so that the scene follows the pointer.
   * @returns Whether it has an effect; false only for a zoom beyond its limit.
   */
  act(action: CameraAction): boolean {
    const isEye = this.#camera.pivot === 'eye';
    if (action.type === 'zoom' && !isEye) return this.zoomBy(action.factor);
    if (action.type === 'reset') this.reset('user-interaction');
    else if (action.type === 'pan') this.panBy(action.right, action.up);
    else if (action.type === 'zoom') this.moveBy(0, 0, -Math.log(action.factor) * this.#bounds.radius);
    else if (isEye) {
      const share = this.fieldOfView.radians / (2 * Math.PI);
      this.lookBy(-share * action.theta, -share * action.phi);
    } else this.orbitBy(action.theta, action.phi);
    return true;
  }

  /** Flies by a visitor's input: moves camera and target along the camera's own axes, in world units. */
  moveBy(right: number, up: number, forward: number): void {
    this.#camera.moveBy(right, up, forward);
    this.#moveByUser();
  }

  /** Walks by a visitor's input: moves the eye to a point of viewer space. Limits of the target do not apply to it. */
  moveEyeTo(eye: Vector3): void {
    this.#camera.setEye(eye);
    this.#moveByUser();
  }

  /**
   * Multiplies the distance to the target by a factor from a visitor's input. @returns False if a limit leaves the
   * distance unchanged.
   */
  zoomBy(factor: number): boolean {
    const { radius } = this.#camera.goal;
    this.#camera.zoomBy(factor);
    if (this.#camera.goal.radius === radius) return false;
    this.#userDistance = true;
    this.#moveByUser();
    return true;
  }

  /** Pans by a visitor's input: moves camera and target, in fractions of the height of the frame at the target. */
  panBy(right: number, up: number): void {
    const { x, y, z } = this.#camera.goal;
    this.#camera.panBy(right, up);
    this.#keepNear([x, y, z]);
    this.#moveByUser();
  }

  /** Sets the orbit target to a point that a visitor has picked, in viewer space. */
  aimAt([x, y, z]: Vector3): void {
    this.#camera.setGoal({ x, y, z });
    this.#moveByUser();
  }

  /**
   * Rotates the camera automatically, without damping.
   * @param theta Angle about the up axis, radians.
   * @returns The angle by which the camera has rotated within its limits, radians.
   */
  turnBy(theta: number): number {
    const turned = this.#camera.turnBy(theta);
    if (turned === 0) return 0;
    this.#source = 'automatic';
    this.#jumped = this.#isTurned = true;
    this.#onChange();
    return turned;
  }

  /**
   * Advances the damped motion to the time of a frame.
   * @param now requestAnimationFrame's clock, ms.
   * @param decayMs Time constant of the motion; 0 jumps to the goal.
   * @returns The source of the camera change since the last step; null without a change.
   */
  step(now: number, decayMs: number): CameraChangeSource | null {
    const stepMs = this.#lastStep === undefined ? FIRST_STEP_MS : Math.min(MAX_STEP_MS, now - this.#lastStep);
    const moved = this.#camera.step(stepMs, decayMs);
    this.#lastStep = this.#camera.moving ? now : undefined;
    const changed = moved || this.#jumped;
    this.#jumped = false;
    return changed ? this.#source : null;
  }

  /**
   * Keeps the target in the framing sphere, so that a pan does not lose the scene. A target that was outside the sphere
   * keeps its distance from the center. Limits of the target that the page sets replace this one.
   */
  #keepNear(before: Vector3): void {
    const { minTarget, maxTarget } = this.#settings;
    if (this.#camera.pivot === 'eye' || [...minTarget, ...maxTarget].some((limit) => limit !== 'auto')) return;
    const middle = toViewer(this.viewerFrame, this.#bounds.center);
    const { x, y, z } = this.#camera.goal;
    const [from, to] = [before, [x, y, z] as const].map((place) => subtract(place, middle));
    const share = Math.max(this.#bounds.radius, Math.hypot(...from)) / Math.hypot(...to);
    if (share >= 1) return;
    const [nearX, nearY, nearZ] = middle.map((value, axis) => value + share * to[axis]);
    this.#camera.setGoal({ x: nearX, y: nearY, z: nearZ });
  }

  #moveByUser(): void {
    // Another distance to the target would move the eye of a camera that flies or walks.
    this.#userDistance ||= this.#camera.pivot === 'eye';
    this.#isTouched = true;
    this.#source = 'user-interaction';
    this.#onChange();
  }

  #limit(): void {
    this.#camera.limits = limitsOf(this.#settings, this.#bounds, this.#aspect, this.#asked);
  }

  #reframe(source: CameraChangeSource): void {
    this.reset(source);
    this.#jumped = true;
    this.jumpToGoal();
  }
}
