import type { Vector3 } from '@gaussian-splat/core';
import type { ReactiveController, ReactiveControllerHost } from 'lit';
import type { Attributes } from '../attributes.js';
import { readAttribute } from '../camera/grammar.js';
import { lengthGrammar, optionalLengthGrammar } from '../camera/lengths.js';
import { eyeOfPose, type ViewerFrame } from '../camera/orbit.js';
import type { ScenePoint } from '../camera/values.js';
import type { AnnouncerController } from '../controllers/announcer-controller.js';
import type { CameraController } from '../controllers/camera-controller.js';
import { MAX_MOVER_STEP_MS, prefersReducedMotion, type Mover } from '../controllers/motion.js';
import type { SceneRequest } from '../loading/protocol.js';
import type { SceneLoader } from '../loading/scene-loader.js';
import type { A11yStrings, WalkWord } from '../words.js';
import { openFloor } from './floor-source.js';
import { Joystick } from './joystick.js';
import { Walker } from './walker.js';

export interface WalkHost {
  readonly element: HTMLElement;
  readonly attributes: Pick<Attributes, 'navigation' | 'walkMap' | 'eyeHeight' | 'unit' | 'cameraControls'>;
  readonly camera: CameraController;
  readonly behaviors: { readonly announcer: { readonly value: Pick<AnnouncerController, 'say'> | undefined } };
  readonly surface: HTMLElement | null;
  readonly frame: ViewerFrame;
  readonly strings: A11yStrings;
  readonly services: { readonly sceneLoader: SceneLoader };
  /** The request of the displayed scene; null without one, and for sources without a file. */
  readonly walkable: SceneRequest | null;
  requestFrame(): void;
  positionFromPoint(clientX: number, clientY: number): Promise<ScenePoint | null>;
  warn(sentence: string): void;
}

const WORDS: Readonly<Record<WalkWord, string>> = {
  'keys-walk':
    'The up and down arrow keys walk, left and right turn, W, A, S and D walk to all sides, with Shift faster. ' +
    'A click on the floor walks there. Home brings the view back.',
  blocked: 'Blocked',
};
/** Minimum area of a floor, m². */
const MIN_AREA = 4;
/** Minimum duration of a short press, ms. */
const FIRST_STEP_MS = 50;
/** Turning speed of the arrow keys, radians per second. */
const TURN = 1.5;
/** Deflection of a stick below which it is ignored. */
const DEAD_ZONE = 0.15;

/** Motion of each key: right, forward, and turn to the left. */
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

/** Walks on the floor of the scene: by keys, by clicks and taps on the floor, by a stick for the thumb, and by a gamepad. */
export class WalkController implements ReactiveController, Mover {
  readonly #host: ReactiveControllerHost & HTMLElement;
  readonly #of: WalkHost;
  readonly #held = new Map<string, readonly [number, number, number]>();
  readonly #joystick: Joystick;
  #walker: Walker | undefined;
  #isFast = false;
  #lastStep: number | undefined;
  #listening: AbortController | undefined;
  /** The scene and settings that the floor was asked for with. */
  #askedFor: string | undefined;
  #opening: AbortController | undefined;
  /** The scene has no floor: the camera flies. */
  #isRefused = false;
  #isSaid = false;
  #gamepads = 0;

  constructor(host: ReactiveControllerHost & HTMLElement, of: WalkHost) {
    this.#host = host;
    this.#of = of;
    this.#joystick = new Joystick(host.ownerDocument, () => of.requestFrame());
    host.addController(this);
  }

  get isRefused(): boolean {
    return this.#isRefused;
  }

  /** Help text for the keys; undefined unless walking. */
  get keys(): string | undefined {
    return this.#of.attributes.navigation === 'walk' && !this.#isRefused ? this.#word('keys-walk') : undefined;
  }

  hostUpdated(): void {
    const { attributes, surface } = this.#of;
    if (attributes.navigation !== 'walk' || surface === null || !surface.isConnected) return this.#stop();
    this.#ask();
    this.#joystick.isShown = attributes.cameraControls && this.#walker !== undefined && isTouchScreen();
    if (!attributes.cameraControls || this.#isRefused) return this.#deafen();
    if (this.#listening !== undefined) return;
    this.#listening = new AbortController();
    const { signal } = this.#listening;
    // Registered before the keys that orbit.
    surface.addEventListener('keydown', this.#onDown, { signal, capture: true });
    surface.addEventListener('keyup', this.#onUp, { signal });
    surface.addEventListener('blur', this.#release, { signal });
    surface.addEventListener('click', this.#onClick, { signal });
    const { defaultView } = surface.ownerDocument;
    defaultView?.addEventListener('gamepadconnected', this.#onGamepad, { signal });
    surface.after(this.#joystick.element);
    if (defaultView?.navigator.getGamepads?.().some(Boolean)) this.#onGamepad();
  }

  hostDisconnected(): void {
    this.#stop();
  }

  advance(now: number): boolean {
    const walker = this.#walker;
    if (walker === undefined) return false;
    const stick = this.#stick();
    const [right, forward, turn] = [...this.#held.values(), stick].reduce(
      (sum, held) => [sum[0] + held[0], sum[1] + held[1], sum[2] + held[2]] as const,
      [0, 0, 0] as const,
    );
    if (right === 0 && forward === 0 && turn === 0 && !walker.isMoving) {
      this.#lastStep = undefined;
      return false;
    }
    const stepMs = this.#lastStep === undefined ? 0 : Math.min(MAX_MOVER_STEP_MS, now - this.#lastStep);
    this.#lastStep = now;
    this.#move(right, forward, turn, stepMs);
    return true;
  }

  /** Walks forward by some meters, for the wheel and pinch gestures. */
  ahead(meters: number): void {
    const walker = this.#walker;
    if (walker === undefined) return;
    const { theta } = this.#of.camera.goal;
    walker.step(Math.abs(meters) / 1.4, -Math.sin(theta) * Math.sign(meters), -Math.cos(theta) * Math.sign(meters));
    this.#follow();
  }

  #move(right: number, forward: number, turn: number, stepMs: number): void {
    const { camera } = this.#of;
    if (stepMs === 0) return;
    const seconds = stepMs / 1000;
    if (turn !== 0) camera.lookBy(turn * TURN * seconds, 0);
    const { theta } = camera.goal;
    const [sin, cos] = [Math.sin(theta), Math.cos(theta)];
    this.#walker!.step(seconds, right * cos - forward * sin, -right * sin - forward * cos, this.#isFast);
    this.#notifyBlocked(right !== 0 || forward !== 0);
    this.#follow();
  }

  /** Puts the camera's eye above the feet. */
  #follow(): void {
    const { camera } = this.#of;
    const { at, eyeFloor } = this.#walker!;
    const { unit = 1, eyeHeight } = this.#settings();
    camera.walkTo([at[0] / unit, (eyeFloor + eyeHeight) / unit, at[2] / unit]);
    this.#of.requestFrame();
  }

  /** A wall is announced to screen readers once. */
  #notifyBlocked(isWalking: boolean): void {
    const isBlocked = isWalking && this.#walker!.isBlocked;
    if (isBlocked && !this.#isSaid) this.#of.behaviors.announcer.value?.say(this.#word('blocked'));
    if (!isBlocked && this.#isSaid && isWalking) this.#of.behaviors.announcer.value?.say('');
    this.#isSaid = isBlocked || (this.#isSaid && !isWalking);
  }

  /** Makes or fetches the floor of the scene once. */
  #ask(): void {
    const { walkable: request, camera, frame, services } = this.#of;
    if (request === null) return;
    const { walkMap, eyeHeight, unit } = this.#settings();
    const key = JSON.stringify([request.url, walkMap, eyeHeight, unit, frame]);
    if (key === this.#askedFor) return;
    this.#forget();
    this.#askedFor = key;
    this.#opening = new AbortController();
    const { signal } = this.#opening;
    const metersPerUnit = unit ?? 1;
    const eye = eyeOfPose(camera.goal).map((value) => value * metersPerUnit) as [number, number, number];
    const mapUrl = walkMap === 'auto' ? null : new URL(walkMap, this.#of.element.baseURI).href;
    openFloor(
      { loader: services.sceneLoader, request, mapUrl, frame, metersPerUnit, eyeHeight, near: eye },
      signal,
    ).then(
      (map) => {
        if (signal.aborted) return;
        if (map.area < MIN_AREA) return this.#refuse(`its floor has ${map.area.toFixed(1)} m², ${MIN_AREA} are needed`);
        this.#walker = new Walker(map, eye);
        camera.level();
        this.#follow();
        camera.jumpToGoal();
        this.#host.requestUpdate();
        this.#of.element.dispatchEvent(new CustomEvent('walk-ready', { detail: { area: map.area } }));
      },
      (error: Error) => {
        if (!signal.aborted) this.#refuse(error.message);
      },
    );
  }

  #refuse(why: string): void {
    this.#isRefused = true;
    this.#of.warn(
      `<gaussian-splat> navigation="walk": ${why}. Visitors fly instead. ` +
        'Check the attributes up and unit, or name a file of gaussian-splat floor in walk-map.',
    );
    this.#host.requestUpdate();
  }

  readonly #onDown = (event: KeyboardEvent): void => {
    const keys = event.code in KEYS ? event.code : event.key;
    const direction = KEYS[keys];
    if (!direction || event.ctrlKey || event.altKey || event.metaKey || !this.#walker) return;
    // Shift with the arrow keys looks up and down, like in flight.
    if (event.shiftKey && keys.startsWith('Arrow')) return;
    event.preventDefault();
    event.stopImmediatePropagation();
    this.#isFast = event.shiftKey;
    // A short press may be over before the next frame.
    if (!event.repeat && !this.#held.has(event.code)) this.#move(...direction, FIRST_STEP_MS);
    this.#held.set(event.code, direction);
    this.#of.requestFrame();
  };

  readonly #onUp = (event: KeyboardEvent): void => {
    this.#isFast = event.shiftKey;
    this.#held.delete(event.code);
    // macOS reports no release of keys while the command key is held.
    if (event.key === 'Meta') this.#held.clear();
  };

  readonly #release = (): void => this.#held.clear();

  /** A click or tap on the floor walks there; visitors who prefer reduced motion jump there at once. */
  readonly #onClick = ({ clientX, clientY }: MouseEvent): void => {
    const walker = this.#walker;
    if (walker === undefined) return;
    const { unit = 1 } = this.#settings();
    this.#of.positionFromPoint(clientX, clientY).then(
      (point) => {
        if (point === null || this.#walker !== walker) return;
        const to: Vector3 = [point.x * unit, point.y * unit, point.z * unit];
        if (!walker.goTo(to)) return;
        if (prefersReducedMotion()) {
          walker.jump();
          this.#follow();
        }
        this.#of.requestFrame();
      },
      (error: Error) => this.#of.warn(error.message),
    );
  };

  /** Reads gamepads between frames while any is connected; only a deflected stick asks for frames. */
  readonly #onGamepad = (): void => {
    const view = this.#host.ownerDocument.defaultView;
    if (this.#gamepads !== 0 || view === null) return;
    const poll = (): void => {
      const isThere = view.navigator.getGamepads().some(Boolean);
      this.#gamepads = isThere && this.#listening !== undefined ? view.requestAnimationFrame(poll) : 0;
      if (this.#stick().some((value) => value !== 0)) this.#of.requestFrame();
    };
    this.#gamepads = view.requestAnimationFrame(poll);
  };

  /** Input of the joystick and the gamepads. */
  #stick(): readonly [right: number, forward: number, turn: number] {
    const pads = this.#gamepads === 0 ? [] : this.#host.ownerDocument.defaultView!.navigator.getGamepads();
    const beyond = (value = 0): number => (Math.abs(value) > DEAD_ZONE ? value : 0);
    let [right, forward, turn] = [this.#joystick.right, this.#joystick.forward, 0];
    for (const pad of pads) {
      if (pad === null) continue;
      right += beyond(pad.axes[0]);
      forward -= beyond(pad.axes[1]);
      turn -= beyond(pad.axes[2]);
    }
    return [right, forward, turn];
  }

  /** Settings of the attributes, in meters. */
  #settings(): { walkMap: string; eyeHeight: number; unit: number | undefined } {
    const { walkMap, eyeHeight, unit } = this.#of.attributes;
    const warn = (sentence: string): void => this.#of.warn(sentence);
    return {
      walkMap: walkMap?.trim() || 'auto',
      eyeHeight: readAttribute('eye-height', eyeHeight, lengthGrammar('1.6m'), warn),
      unit: readAttribute('unit', unit, optionalLengthGrammar, warn),
    };
  }

  #word(key: WalkWord): string {
    return this.#of.strings[key] ?? WORDS[key];
  }

  #forget(): void {
    this.#opening?.abort();
    this.#askedFor = undefined;
    this.#walker = undefined;
    this.#isRefused = this.#isSaid = false;
  }

  #deafen(): void {
    this.#listening?.abort();
    this.#listening = undefined;
    this.#held.clear();
    this.#joystick.element.remove();
  }

  #stop(): void {
    this.#deafen();
    this.#forget();
  }
}

/** Whether fingers are the main pointer. */
const isTouchScreen = (): boolean => globalThis.matchMedia?.('(pointer: coarse)').matches ?? false;
