import { subtract, type Camera, type Vector3 } from '@gaussian-splat/core';
import {
  cameraOfPose,
  framingDistance,
  nearPlane,
  toViewer,
  type CameraPose,
  type ViewerFrame,
} from '../camera/orbit.js';
import { OrbitCamera, type Pivot } from '../camera/orbit-camera.js';
import { frameOf, limitsOf, poseOf, type CameraSettings, type SceneBounds } from '../camera/settings.js';
import { CameraOrbit, CameraTarget, FieldOfView } from '../camera/values.js';
import type { CameraChangeSource } from '../events.js';
import type { ViewContext } from '../views/camera-view.js';

/** All of a subject that stands alone is shown, of other scenes their middle. */
const framed = (bounds: SceneBounds): SceneBounds => ({ ...bounds, ...bounds.subject });

/** What is framed before any scene is known. */
const UNKNOWN_BOUNDS: SceneBounds = { min: [-1, -1, -1], max: [1, 1, 1], center: [0, 0, 0], radius: 1 };
/** Longest step of the damped motion, ms: after a pause the camera goes on from where it was. */
const MAX_STEP_MS = 100;
/** Length of the first step after a standstill, ms. */
const FIRST_STEP_MS = 1000 / 60;

/**
 * The element's camera: brings together the attributes, the scene's bounds and the picture's aspect, and says where the
 * camera is at a given time.
 */
export class CameraController {
  readonly #camera: OrbitCamera;
  readonly #onChange: () => void;
  #settings: CameraSettings;
  #bounds = UNKNOWN_BOUNDS;
  #aspect = 1;
  #source: CameraChangeSource = 'none';
  /** A person has zoomed since the attributes last set the distance; then a new aspect leaves it alone. */
  #userDistance = false;
  /** A person has moved the camera since a scene was framed. */
  #isTouched = false;
  /** The element itself has turned it. */
  #isTurned = false;
  #jumped = false;
  /** Where a flight has put the camera: automatic limits give way to it. */
  #asked: CameraPose | undefined;
  #lastStep: number | undefined;

  /** @param onChange the camera is no longer where it was drawn. */
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

  /** Rotation from the scene's frame to viewer space, in which orbit and target are. */
  get viewerFrame(): ViewerFrame {
    return frameOf(this.#settings, this.#bounds);
  }

  /** What was framed last, in the scene's own frame: of a subject that stands alone, `center` and `radius` are of all of it. */
  get bounds(): SceneBounds {
    return this.#bounds;
  }

  /** What stays on course while a person moves: see {@link OrbitCamera.pivot}. */
  set pivot(pivot: Pivot) {
    this.#camera.pivot = pivot;
  }

  /** A person has moved the camera since it stood where the page put it. */
  get isTouched(): boolean {
    return this.#isTouched;
  }

  /** Where it is going. */
  get goal(): CameraPose {
    return this.#camera.goal;
  }

  /** What views are read against. */
  get context(): ViewContext {
    const [settings, bounds, aspect, from] = [this.#settings, this.#bounds, this.#aspect, this.#camera.goal];
    return { settings, bounds, frame: this.viewerFrame, aspect, from };
  }

  /** Puts the camera there at once, within the limits that the page has set: a step of a flight. */
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

  /** The pinhole camera of this moment for a picture of width x height pixels. */
  view(width: number, height: number): Camera {
    return cameraOfPose(this.#camera.now, this.viewerFrame, width, height, nearPlane(this.#bounds));
  }

  /**
   * New attributes. What was not set keeps the place that a person may have given it.
   * @param set what the page has set, be it to the value that it had
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

  /** A new scene: the camera stands where the attributes ask, at once. */
  frame(bounds: SceneBounds): void {
    this.#bounds = framed(bounds);
    this.#isTouched = this.#isTurned = false;
    this.#reframe('automatic');
  }

  /** More of the scene is known: the camera goes where it would have stood, unless a person has moved it. */
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

  /** A new shape of the picture: an automatic distance follows, at once. */
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

  /** Where the attributes put the camera, whatever a person did since. */
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

  /** A person turns the camera, angles in radians. */
  orbitBy(theta: number, phi: number): void {
    this.#camera.orbitBy(theta, phi);
    this.#moveByUser();
  }

  /** A person looks around from where the camera is, angles in radians. */
  lookBy(theta: number, phi: number): void {
    this.#camera.lookBy(theta, phi);
    this.#moveByUser();
  }

  /** A person flies: world units along the camera's own axes. */
  moveBy(right: number, up: number, forward: number): void {
    this.#camera.moveBy(right, up, forward);
    this.#moveByUser();
  }

  /** A person walks: puts the eye at a point of viewer space. Limits of the target do not apply to it. */
  walkTo(eye: Vector3): void {
    this.#camera.setEye(eye);
    this.#moveByUser();
  }

  /** Looks straight ahead, at once: the pose of somebody who begins to walk. */
  level(): void {
    const { phi } = this.#camera.goal;
    this.#camera.lookBy(0, Math.PI / 2 - phi);
    this.jumpToGoal();
  }

  /** A person changes the distance by a factor. @returns false at the limit */
  zoomBy(factor: number): boolean {
    const { radius } = this.#camera.goal;
    this.#camera.zoomBy(factor);
    if (this.#camera.goal.radius === radius) return false;
    this.#userDistance = true;
    this.#moveByUser();
    return true;
  }

  /** A person moves the camera sideways, in shares of the picture's height. */
  panBy(right: number, up: number): void {
    const { x, y, z } = this.#camera.goal;
    this.#camera.panBy(right, up);
    this.#keepNear([x, y, z]);
    this.#moveByUser();
  }

  /** A person picks another point to turn around: viewer space. */
  aimAt([x, y, z]: Vector3): void {
    this.#camera.setGoal({ x, y, z });
    this.#moveByUser();
  }

  /**
   * The element itself turns the camera, radians; nothing is damped.
   * @returns how far the limits let it
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
   * Moves on to the time `now`.
   * @param now requestAnimationFrame's clock, ms.
   * @param decayMs time constant of the motion; 0 jumps.
   * @returns who moved the camera since the last step, or null if nothing did.
   */
  step(now: number, decayMs: number): CameraChangeSource | null {
    const stepMs = this.#lastStep === undefined ? FIRST_STEP_MS : Math.min(MAX_STEP_MS, now - this.#lastStep);
    const moved = this.#camera.step(stepMs, decayMs);
    this.#lastStep = this.#camera.moving ? now : undefined;
    const changed = moved || this.#jumped;
    this.#jumped = false;
    return changed ? this.#source : null;
  }

  /** Keeps the target in the ball that is framed, so that no pan loses the scene. One that was farther out stays where it was. Limits that the page has set count alone. */
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
