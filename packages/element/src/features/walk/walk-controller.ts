import { subtract, type Vector3 } from '@gaussian-splat/core';
import type { FloorMap } from '@gaussian-splat/formats/floor';
import type { ReactiveController } from 'lit';
import { readAttribute } from '../../viewer/camera/grammar.js';
import { lengthGrammar } from '../../viewer/camera/lengths.js';
import { eyeOfPose, toViewer } from '../../viewer/camera/orbit.js';
import type { CameraAction } from '../../viewer/camera/gestures.js';
import { MAX_MOVER_STEP_MS, prefersReducedMotion } from '../../viewer/motion.js';
import type { Feature } from '../../viewer/features.js';
import { LatestTask } from '../../viewer/latest-task.js';
import { unitOf } from '../../viewer/unit.js';
import type { Viewer } from '../../viewer/viewer.js';
import { mapUrlOf, openFloor, rewritten } from '../../floor/floor-source.js';
import { Gamepads } from './gamepads.js';
import { Joystick } from './joystick.js';
import { FloorBody } from '../../floor/floor-body.js';

const WORDS = {
  'keys-walk':
    'The up and down arrow keys walk, left and right turn, W, A, S and D walk to all sides, with Shift faster. ' +
    'A click on the floor walks there. Home brings the view back.',
  blocked: 'Blocked',
};
/** Meters that a zoom by the factor e moves the camera. */
const WHEEL_METERS = 2;
/** Minimum area of a floor, m². */
const MIN_AREA = 4;
/** Duration of motion that a short key press causes at least, milliseconds. */
const FIRST_STEP_MS = 50;
/** Speed of rotation by the arrow keys, radians per second. */
const TURN = 1.5;
/** Distance of the camera from the walker's eyes, meters, above which something else has moved the camera. */
const STRAYED = 0.01;

/** Motion of each key, by KeyboardEvent.code: to the right, forward, and rotation to the left, -1..1. */
const KEYS: Readonly<Record<string, readonly [right: number, forward: number, turn: number]>> = {
  KeyW: [0, 1, 0],
  KeyS: [0, -1, 0],
  KeyA: [-1, 0, 0],
  KeyD: [1, 0, 0],
  ArrowUp: [0, 1, 0],
  ArrowDown: [0, -1, 0],
  ArrowLeft: [0, 0, 1],
  ArrowRight: [0, 0, -1],
};

/** Moves the camera on the floor of the scene: by keys, clicks and taps on the floor, a joystick, and gamepads. */
export class WalkController implements ReactiveController, Feature {
  readonly #viewer: Viewer;
  readonly #held = new Map<string, readonly [number, number, number]>();
  readonly #joystick: Joystick;
  readonly #gamepads: Gamepads;
  #walker: FloorBody | undefined;
  /** Point near the start of the walk, viewer space in meters. */
  #start: Vector3 = [0, 0, 0];
  /** Position of the camera's eye after the last motion of the walker, viewer space in scene units. */
  #eye: Vector3 = [0, 0, 0];
  #isFast = false;
  #lastStep: number | undefined;
  #listening: AbortController | undefined;
  /** Key of the scene and settings that the floor was requested for; undefined before a request. */
  #askedFor: string | undefined;
  readonly #opening = new LatestTask();
  #isSaid = false;

  constructor(viewer: Viewer) {
    this.#viewer = viewer;
    const { ownerDocument: page } = viewer.element;
    this.#joystick = new Joystick(page, () => viewer.requestFrame());
    this.#gamepads = new Gamepads(page.defaultView, () => viewer.requestFrame());
    viewer.element.addController(this);
  }

  /** Whether the camera walks on the floor. It does not move until a floor is found. */
  get #walks(): boolean {
    return this.#viewer.navigation === 'walk';
  }

  keys(): string | undefined {
    return this.#walks ? this.#word('keys-walk') : undefined;
  }

  act(action: CameraAction): boolean | undefined {
    if (!this.#walks) return undefined;
    if (action.type === 'zoom') this.#ahead(-WHEEL_METERS * Math.log(action.factor));
    return action.type === 'zoom' || action.type === 'pan' ? true : undefined;
  }

  /** A click selects a destination, also the second one of a double click. */
  pick(): true | undefined {
    return this.#viewer.attributes.navigation === 'walk' || undefined;
  }

  hostUpdated(): void {
    const { attributes, surface } = this.#viewer;
    if (attributes.navigation !== 'walk' || surface === null || !surface.isConnected) return this.hostDisconnected();
    this.#ask();
    this.#joystick.isShown = attributes.cameraControls && this.#walker !== undefined && isTouchScreen();
    if (!attributes.cameraControls || !this.#walks) return this.#deafen();
    if (this.#listening !== undefined) return;
    this.#listening = new AbortController();
    const { signal } = this.#listening;
    // Capturing listeners are called before the listener for the keys that orbit.
    surface.addEventListener('keydown', this.#onDown, { signal, capture: true });
    surface.addEventListener('keyup', this.#onUp, { signal });
    surface.addEventListener('blur', this.#release, { signal });
    surface.addEventListener('click', this.#onClick, { signal });
    this.#viewer.element.addEventListener('click', this.#onSceneClick, { signal });
    this.#gamepads.listen(signal);
    surface.after(this.#joystick.element);
  }

  advance(now: number): boolean {
    if (this.#walker === undefined) return false;
    // A reset of the camera also returns the walker to the start. A new scene has its own start.
    if (!this.#viewer.camera.isTouched && this.#viewer.stillRequest !== null) this.#begin(this.#walker.map);
    const stick = this.#stick();
    const [right, forward, turn] = [...this.#held.values(), stick].reduce(
      (sum, held) => [sum[0] + held[0], sum[1] + held[1], sum[2] + held[2]] as const,
      [0, 0, 0] as const,
    );
    if (right === 0 && forward === 0 && turn === 0 && !this.#walker.isMoving) {
      this.#lastStep = undefined;
      return false;
    }
    const stepMs = this.#lastStep === undefined ? 0 : Math.min(MAX_MOVER_STEP_MS, now - this.#lastStep);
    this.#lastStep = now;
    this.#move(right, forward, turn, stepMs);
    return true;
  }

  /** Walks forward, or backward if negative, by a distance in meters. For the wheel and pinch gestures. */
  #ahead(meters: number): void {
    const walker = this.#walker;
    if (walker === undefined) return;
    this.#land();
    const { theta } = this.#viewer.camera.goal;
    walker.step(Math.abs(meters) / 1.4, -Math.sin(theta) * Math.sign(meters), -Math.cos(theta) * Math.sign(meters));
    this.#follow();
  }

  #move(right: number, forward: number, turn: number, stepMs: number): void {
    const { camera } = this.#viewer;
    if (stepMs === 0) return;
    const seconds = stepMs / 1000;
    this.#land();
    if (turn !== 0) camera.lookBy(turn * TURN * seconds, 0);
    const { theta } = camera.goal;
    const [sin, cos] = [Math.sin(theta), Math.cos(theta)];
    this.#walker!.step(seconds, right * cos - forward * sin, -right * sin - forward * cos, this.#isFast);
    this.#notifyBlocked(right !== 0 || forward !== 0);
    this.#follow();
  }

  /**
   * Moves the walker to its start at once, and levels the view. Unless `camera-orbit` has a direction, or the first view
   * is within the scene and shows much of it, the walker looks where the floor extends far.
   */
  #begin(map: FloorMap): void {
    const { camera } = this.#viewer;
    const { settings, from, bounds } = camera.context;
    const walker = (this.#walker = new FloorBody(map, this.#start));
    const isChosen = settings.orbit.theta !== 'auto' || (bounds.inside && this.#isFramed);
    const turn = isChosen ? 0 : walker.openDirection(from.theta) - from.theta;
    camera.lookBy(turn, Math.PI / 2 - from.phi);
    this.#follow();
    camera.jumpToGoal();
  }

  /** Whether the attributes leave the position of the camera to the element. */
  get #isFramed(): boolean {
    const { orbit, target } = this.#viewer.camera.context.settings;
    return [orbit.radius, ...target].every((value) => value === 'auto');
  }

  /** Moves the camera's eye to its height above the feet. */
  #follow(): void {
    const { camera } = this.#viewer;
    const { at, eyeFloor } = this.#walker!;
    const { unit = 1, eyeHeight } = this.#settings();
    camera.moveEyeTo([at[0] / unit, (eyeFloor + eyeHeight) / unit, at[2] / unit]);
    this.#eye = eyeOfPose(camera.goal);
    this.#viewer.requestFrame();
  }

  /** Moves the walker to the floor below the camera if a view, a flight or an attribute has moved the camera. */
  #land(): void {
    const { unit = 1 } = this.#settings();
    const eye = eyeOfPose(this.#viewer.camera.goal);
    const [x, y, z] = subtract(eye, this.#eye);
    if (Math.hypot(x, y, z) * unit > STRAYED) this.#walker!.land(inMeters(eye, unit));
  }

  /** Announces to screen readers, once, that a wall blocks the way. */
  #notifyBlocked(isWalking: boolean): void {
    const isBlocked = isWalking && this.#walker!.isBlocked;
    if (isBlocked && !this.#isSaid) this.#viewer.announcer.value?.say(this.#word('blocked'));
    if (!isBlocked && this.#isSaid && isWalking) this.#viewer.announcer.value?.say('');
    this.#isSaid = isBlocked || (this.#isSaid && !isWalking);
  }

  /** Computes or fetches the floor, once for each scene and settings. */
  #ask(): void {
    const { stillRequest: request, attributes, camera, frame, services } = this.#viewer;
    if (request === null) return;
    const { eyeHeight, unit } = this.#settings();
    const key = JSON.stringify([request.url, attributes.walkMap, eyeHeight, unit, frame]);
    if (key === this.#askedFor) return;
    this.#forget();
    this.#askedFor = key;
    const metersPerUnit = unit ?? 1;
    const { inside } = camera.context.bounds;
    const eye = inside && this.#isFramed && !camera.isTouched ? toViewer(frame, inside.center) : eyeOfPose(camera.goal);
    const near = (this.#start = inMeters(eye, metersPerUnit));
    const options = { loader: services.sceneLoader, request, frame, metersPerUnit, eyeHeight, near };
    this.#opening.run(
      async (signal) => {
        const map = await openFloor({ ...options, mapUrl: rewritten(this.#viewer, mapUrlOf(this.#viewer)) }, signal);
        if (signal.aborted) return;
        if (map.area < MIN_AREA) return this.#refuse(`its floor has ${map.area.toFixed(1)} m², ${MIN_AREA} are needed`);
        this.#begin(map);
        this.#viewer.element.requestUpdate();
        this.#viewer.element.dispatchEvent(new CustomEvent('walk-ready', { detail: { area: map.area } }));
      },
      (error) => this.#refuse((error as Error).message),
    );
  }

  #refuse(why: string): void {
    this.#viewer.refuseNavigation('walk');
    this.#viewer.warn(
      `<gaussian-splat> navigation="walk": ${why}. Visitors fly instead. ` +
        'Check the attributes up and unit, or name a file of gaussian-splat floor in walk-map.',
    );
  }

  readonly #onDown = (event: KeyboardEvent): void => {
    const keys = event.code in KEYS ? event.code : event.key;
    const direction = KEYS[keys];
    if (!direction || event.ctrlKey || event.altKey || event.metaKey || !this.#walker) return;
    // Shift with the arrow keys rotates the view up and down, as in flight.
    if (event.shiftKey && keys.startsWith('Arrow')) return;
    event.preventDefault();
    event.stopImmediatePropagation();
    this.#isFast = event.shiftKey;
    // A short key press may end before the next frame, so it moves the camera at once.
    if (!event.repeat && !this.#held.has(event.code)) this.#move(...direction, FIRST_STEP_MS);
    this.#held.set(event.code, direction);
    this.#viewer.requestFrame();
  };

  readonly #onUp = (event: KeyboardEvent): void => {
    this.#isFast = event.shiftKey;
    this.#held.delete(event.code);
    // macOS reports no release of keys while the command key is held.
    if (event.key === 'Meta') this.#held.clear();
  };

  readonly #release = (): void => this.#held.clear();

  /** Walks to a click on the frame. If it may belong to an interactive child, {@link #onSceneClick} follows. */
  readonly #onClick = (event: MouseEvent): void => {
    const children = [...this.#viewer.element.children] as (HTMLElement & { readonly interactive?: boolean })[];
    if (!children.some(({ interactive, hidden }) => interactive && !hidden)) this.#walkTo(event);
  };

  /** Walks to a click that was dispatched to the element itself, because it hits no interactive child. */
  readonly #onSceneClick = (event: MouseEvent): void => {
    if (event.target === this.#viewer.element && 'hit' in event) this.#walkTo(event);
  };

  /** Walks to the point of a click or tap on the floor. Visitors who prefer reduced motion jump there at once. */
  #walkTo({ clientX, clientY }: MouseEvent): void {
    const walker = this.#walker;
    if (walker === undefined) return;
    const { unit = 1 } = this.#settings();
    this.#viewer.positionFromPoint(clientX, clientY).then(
      async (point) => {
        if (point === null || this.#walker !== walker) return;
        this.#land();
        const isFound = await walker.goTo(inMeters([point.x, point.y, point.z], unit));
        if (!isFound || this.#walker !== walker) return;
        if (prefersReducedMotion()) {
          walker.jump();
          this.#follow();
        }
        this.#viewer.requestFrame();
      },
      (error: Error) => this.#viewer.warn(error.message),
    );
  }

  /** Sum of the inputs of the joystick and the gamepads. Each input is -1..1. */
  #stick(): readonly [right: number, forward: number, turn: number] {
    const [right, forward, turn] = this.#gamepads.deflection;
    return [right + this.#joystick.right, forward + this.#joystick.forward, turn];
  }

  /** Returns the settings of the attributes. Lengths are in meters; `unit` is undefined if neither page nor file has it. */
  #settings(): { eyeHeight: number; unit: number | undefined } {
    const { eyeHeight } = this.#viewer.attributes;
    const warn = (sentence: string): void => this.#viewer.warn(sentence);
    return {
      eyeHeight: readAttribute('eye-height', eyeHeight, lengthGrammar('1.6m'), warn),
      unit: unitOf(this.#viewer),
    };
  }

  #word(key: keyof typeof WORDS): string {
    return this.#viewer.strings[key] ?? WORDS[key];
  }

  #forget(): void {
    this.#opening.renew();
    this.#askedFor = undefined;
    this.#walker = undefined;
    this.#isSaid = false;
    this.#viewer.refuseNavigation(undefined);
  }

  #deafen(): void {
    this.#listening?.abort();
    this.#listening = undefined;
    this.#held.clear();
    this.#joystick.remove();
  }

  hostDisconnected(): void {
    this.#deafen();
    this.#forget();
  }
}

const inMeters = ([x, y, z]: Vector3, unit: number): Vector3 => [x * unit, y * unit, z * unit];

/** Whether the primary pointer is coarse, such as a finger. */
const isTouchScreen = (): boolean => globalThis.matchMedia?.('(pointer: coarse)').matches ?? false;
