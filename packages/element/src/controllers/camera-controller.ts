import { subtract, type Camera, type Vector3 } from '@gaussian-splat/core';
import {
  cameraOfPose,
  framingDistance,
  nearPlane,
  parallelCamera,
  toViewer,
  type CameraPose,
  type ViewerFrame,
} from '../camera/orbit.js';
import { OrbitCamera, type Pivot } from '../camera/orbit-camera.js';
import { frameOf, limitsOf, poseOf, type CameraSettings, type SceneBounds } from '../camera/settings.js';
import { CameraOrbit, CameraTarget, FieldOfView } from '../camera/values.js';
import type { CameraChangeSource } from '../events.js';
import type { ViewContext } from '../views/camera-view.js';

/** Frames the whole of an isolated subject, and the center of other scenes. */
const framed = (bounds: SceneBounds): SceneBounds => ({ ...bounds, ...bounds.subject });

/** Bounds before any scene is loaded. */
const UNKNOWN_BOUNDS: SceneBounds = { min: [-1, -1, -1], max: [1, 1, 1], center: [0, 0, 0], radius: 1 };
/** Longest step of the damped motion, ms: after a pause the camera continues from its last pose. */
const MAX_STEP_MS = 100;
/** Length of the first step after a rest, ms. */
const FIRST_STEP_MS = 1000 / 60;

/**
 * The element's camera: combines the attributes, the scene's bounds and the frame's aspect ratio into a pose at a given
 * time.
 */
export class CameraController {
  readonly #camera: OrbitCamera;
  readonly #onChange: () => void;
  #settings: CameraSettings;
  #bounds = UNKNOWN_BOUNDS;
  #aspect = 1;
  #source: CameraChangeSource = 'none';
  /**
   * Whether a visitor has zoomed since the attributes last set the distance; then a new aspect ratio does not change
   * it.
   */
  #userDistance = false;
  /** Whether a visitor has moved the camera since a scene was framed. */
  #isTouched = false;
  /** Whether the element itself has rotated it. */
  #isTurned = false;
  #jumped = false;
  /** Pose of a flight, which extends automatic limits. */
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

  /** The framed bounds, in scene coordinates: for an isolated subject, `center` and `radius` are those of all of it. */
  get bounds(): SceneBounds {
    return this.#bounds;
  }

  /** Fixed point of a visitor's motion: see {@link OrbitCamera.pivot}. */
  set pivot(pivot: Pivot) {
    this.#camera.pivot = pivot;
  }

  /** Whether a visitor has moved the camera since the page last set it. */
  get isTouched(): boolean {
    return this.#isTouched;
  }

  /** The goal of the motion. */
  get goal(): CameraPose {
    return this.#camera.goal;
  }

  /** Context for parsing views. */
  get context(): ViewContext {
    const [settings, bounds, aspect, from] = [this.#settings, this.#bounds, this.#aspect, this.#camera.goal];
    return { settings, bounds, frame: this.viewerFrame, aspect, from };
  }

  /** Moves the camera at once, within the limits of the page: a step of a flight. */
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

  /** The current pinhole camera for a frame of width x height pixels. */
  view(width: number, height: number): Camera {
    const { now } = this.#camera;
    const { min, max, center } = this.#bounds;
    const camera = cameraOfPose(now, this.viewerFrame, width, height, nearPlane(this.#bounds));
    if (!this.#settings.orthographic) return camera;
    const away = subtract(toViewer(this.viewerFrame, center), [now.x, now.y, now.z]);
    return parallelCamera(camera, now.radius, Math.hypot(...away) + Math.hypot(...subtract(max, min)));
  }

  /**
   * Applies new attributes. Unset components keep the pose that a visitor may have chosen.
   * @param set Attributes that the page has set, even to the same value.
   */
  applySettings(settings: CameraSettings, set: ReadonlySet<keyof CameraSettings> = new Set()): void {
    const old = this.#settings;
    this.#settings = settings;
    this.#limit();
    const { theta, phi, radius, x, y, z, fieldOfView } = poseOf(settings, this.#bounds, this.#aspect);
    const changed = (key: keyof CameraSettings): boolean =>
      set.has(key) || JSON.stringify(old[key]) !== JSON.stringify(settings[key]);
    this.#source = 'none';
    if (changed('up')) return this.#reframe('none');
    if (changed('fieldOfView')) this.#camera.setGoal({ fieldOfView });
    if (changed('target')) this.#camera.setGoal({ x, y, z });
    if (changed('orbit')) {
      this.#userDistance = false;
      this.#camera.setGoal({ theta, phi, radius });
      this.#camera.unwind();
    } else if (changed('fieldOfView') && !this.#userDistance) {
      this.#camera.setGoal({ radius });
    }
    this.#onChange();
  }

  /** Frames a new scene: the camera moves at once to the pose of the attributes. */
  frame(bounds: SceneBounds): void {
    this.#bounds = framed(bounds);
    this.#isTouched = this.#isTurned = false;
    this.#reframe('automatic');
  }

  /** Updates the bounds: the camera moves to the resulting pose, unless a visitor has moved it. */
  refine(bounds: SceneBounds): void {
    this.#bounds = framed(bounds);
    this.#limit();
    if (!this.#isTouched) {
      this.#source = 'automatic';
      const { theta, ...pose } = poseOf(this.#settings, this.#bounds, this.#aspect);
      this.#camera.setGoal(this.#isTurned ? pose : { theta, ...pose });
    }
    this.#onChange();
  }

  /** Applies a new aspect ratio: an automatic distance follows at once. */
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

  /** Returns to the pose of the attributes. */
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

  /** Orbits by a visitor's input, angles in radians. */
  orbitBy(theta: number, phi: number): void {
    this.#camera.orbitBy(theta, phi);
    this.#moveByUser();
  }

  /** Looks around from the current position by a visitor's input, angles in radians. */
  lookBy(theta: number, phi: number): void {
    this.#camera.lookBy(theta, phi);
    this.#moveByUser();
  }

  /** Flies by a visitor's input: world units along the camera's own axes. */
  moveBy(right: number, up: number, forward: number): void {
    this.#camera.moveBy(right, up, forward);
    this.#moveByUser();
  }

  /** Walks by a visitor's input: moves the eye to a point of viewer space. Limits of the target do not apply to it. */
  walkTo(eye: Vector3): void {
    this.#camera.setEye(eye);
    this.#moveByUser();
  }

  /** Levels the view at once: the initial pose of a walker. */
  level(): void {
    const { phi } = this.#camera.goal;
    this.#camera.lookBy(0, Math.PI / 2 - phi);
    this.jumpToGoal();
  }

  /** Changes the distance by a factor from a visitor's input. @returns False at the limit. */
  zoomBy(factor: number): boolean {
    const { radius } = this.#camera.goal;
    this.#camera.zoomBy(factor);
    if (this.#camera.goal.radius === radius) return false;
    this.#userDistance = true;
    this.#moveByUser();
    return true;
  }

  /** Pans by a visitor's input, in fractions of the frame's height. */
  panBy(right: number, up: number): void {
    const { x, y, z } = this.#camera.goal;
    this.#camera.panBy(right, up);
    this.#keepNear([x, y, z]);
    this.#moveByUser();
  }

  /** Sets the orbit target that a visitor picks, in viewer space. */
  aimAt([x, y, z]: Vector3): void {
    this.#camera.setGoal({ x, y, z });
    this.#moveByUser();
  }

  /**
   * Rotates the camera automatically, radians, without damping.
   * @returns The angle within the limits.
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
   * Advances to the time `now`.
   * @param now requestAnimationFrame's clock, ms.
   * @param decayMs Time constant of the motion; 0 jumps.
   * @returns The source of the camera change since the last step, or null without a change.
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
   * Keeps the target in the framing sphere, so that no pan loses the scene. A target that was farther out keeps its
   * distance. Limits of the page replace this one.
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
