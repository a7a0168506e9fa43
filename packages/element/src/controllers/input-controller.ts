import type { ReactiveController, ReactiveControllerHost } from 'lit';
import { DoubleTap } from '../camera/double-tap.js';
import {
  isCameraDrag,
  keyOf,
  orbitOf,
  panOf,
  pinchOf,
  TOUCH_SLOP,
  wheelOf,
  type CameraAction,
  type Point,
} from '../camera/gestures.js';

/** What people may do. */
export interface InputOptions {
  readonly enabled: boolean;
  readonly zoom: boolean;
  readonly pan: boolean;
  /** CSS touch-action of the picture: which one-finger moves stay the page's. */
  readonly touchAction: string;
}

/** Who hears of it. */
export interface InputHost {
  /** The element that is dragged and focused, once it is rendered. */
  readonly surface: HTMLElement | null;
  /** Read after every update of the element. */
  readonly input: InputOptions;
  act(action: CameraAction): void;
  /** A double click or a double tap, in CSS pixels of the page. */
  pick(clientX: number, clientY: number): void;
  /** The space bar; false if it means nothing here. */
  toggleMotion(): boolean;
}

const LEFT_BUTTON = 0;
const RIGHT_BUTTON = 2;

/** A pointer that is down on the picture. */
interface Pointer extends Point {
  readonly pans: boolean;
  /** Whose its moves are: of one finger this is known only once it has set out. */
  readonly owner: 'camera' | 'page' | 'undecided';
}

/** Listens to mouse, pen, touch, wheel and keys on the picture, and turns them into camera actions. */
export class InputController implements ReactiveController {
  readonly #of: InputHost;
  readonly #pointers = new Map<number, Pointer>();
  readonly #doubleTap = new DoubleTap();
  /** The last pointer was a finger: whether its second tap is a double click, too, differs from browser to browser, and it counts once. */
  #isTouched = false;
  /** The space bar meant something when it was pressed. */
  #toggles = false;
  #surface: HTMLElement | null = null;
  #listening: AbortController | undefined;
  #wheel: AbortController | undefined;

  constructor(host: ReactiveControllerHost, of: InputHost) {
    this.#of = of;
    host.addController(this);
  }

  hostConnected(): void {
    this.#sync();
  }

  hostUpdated(): void {
    this.#sync();
  }

  hostDisconnected(): void {
    this.#stop();
  }

  #sync(): void {
    this.#surface = this.#of.surface;
    if (this.#surface === null) return;
    const { enabled, zoom, touchAction } = this.#of.input;
    this.#surface.style.touchAction = !enabled ? '' : zoom ? touchAction : withPinch(touchAction);
    if (!enabled) return this.#stop();
    this.#listening ??= this.#listen(this.#surface);
    // A wheel listener that may prevent scrolling costs the page; it exists only where the wheel zooms.
    if (zoom) this.#wheel ??= this.#listenToWheel(this.#surface);
    else this.#stopWheel();
  }

  #listen(surface: HTMLElement): AbortController {
    const listening = new AbortController();
    const { signal } = listening;
    surface.addEventListener('pointerdown', this.#onDown, { signal });
    surface.addEventListener('pointermove', this.#onMove, { signal });
    for (const type of ['pointerup', 'pointercancel', 'lostpointercapture'] as const) {
      surface.addEventListener(type, this.#onUp, { signal });
    }
    surface.addEventListener('keydown', this.#onKey, { signal });
    surface.addEventListener('dblclick', this.#onDoubleClick, { signal });
    surface.addEventListener('contextmenu', this.#onContextMenu, { signal });
    surface.addEventListener('touchmove', this.#onTouchMove, { signal, passive: false });
    return listening;
  }

  #listenToWheel(surface: HTMLElement): AbortController {
    const listening = new AbortController();
    surface.addEventListener('wheel', this.#onWheel, { signal: listening.signal, passive: false });
    return listening;
  }

  #stop(): void {
    this.#listening?.abort();
    this.#listening = undefined;
    this.#stopWheel();
    this.#pointers.clear();
    this.#doubleTap.cancel();
  }

  #stopWheel(): void {
    this.#wheel?.abort();
    this.#wheel = undefined;
  }

  readonly #onDown = (event: PointerEvent): void => {
    if (event.button !== LEFT_BUTTON && event.button !== RIGHT_BUTTON) return;
    const pans = event.button === RIGHT_BUTTON || event.shiftKey || event.ctrlKey || event.metaKey;
    this.#isTouched = event.pointerType === 'touch';
    if (this.#isTouched) this.#doubleTap.down(positionOf(event), event.timeStamp, this.#pointers.size === 0);
    const owner = this.#isTouched ? 'undecided' : 'camera';
    this.#pointers.set(event.pointerId, { ...positionOf(event), pans, owner });
    this.#capture(event.pointerId);
  };

  /** Keeps a drag going outside of the element. */
  #capture(pointerId: number): void {
    try {
      this.#surface?.setPointerCapture(pointerId);
    } catch {
      // The pointer is gone already, or was made by a script; then moves arrive only over the element.
    }
  }

  readonly #onMove = (event: PointerEvent): void => {
    const from = this.#pointers.get(event.pointerId);
    const height = this.#surface?.clientHeight ?? 0;
    // Where a dialog or a menu of the browser had it, nobody said that the button was released.
    if (event.buttons === 0 && event.pointerType === 'mouse') this.#pointers.delete(event.pointerId);
    else if (from !== undefined && height > 0) this.#follow(event, from, height);
  };

  #follow(event: PointerEvent, from: Pointer, height: number): void {
    const to = positionOf(event);
    const other = [...this.#pointers].find(([id]) => id !== event.pointerId)?.[1];
    if (!other && from.owner === 'undecided') return this.#decide(event.pointerId, from, to);
    this.#pointers.set(event.pointerId, { ...from, ...to });
    if (other) this.#movePair([from, other], [to, other], height);
    else if (from.owner === 'camera') this.#perform(from.pans ? panOf(from, to, height) : orbitOf(from, to, height));
  }

  /** Finds out whose a finger is; its drag counts from here on, so that the camera does not jump. */
  #decide(pointerId: number, from: Pointer, to: Point): void {
    if (Math.hypot(to.x - from.x, to.y - from.y) < TOUCH_SLOP) return;
    const owner = isCameraDrag(this.#of.input.touchAction, from, to) ? 'camera' : 'page';
    this.#pointers.set(pointerId, { ...from, ...to, owner });
  }

  readonly #onUp = (event: PointerEvent): void => {
    const wasDown = this.#pointers.delete(event.pointerId);
    if (!wasDown || event.pointerType !== 'touch') return;
    if (event.type !== 'pointerup') this.#doubleTap.cancel();
    else if (this.#doubleTap.up(positionOf(event), event.timeStamp)) this.#pick(event);
  };

  readonly #onKey = (event: KeyboardEvent): void => {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    if (event.key === ' ') {
      // Held down it scrolls no page, either.
      this.#toggles = event.repeat ? this.#toggles : this.#of.toggleMotion();
      if (this.#toggles) event.preventDefault();
      return;
    }
    const action = keyOf(event.key, event.shiftKey);
    if (action !== null && this.#perform(action)) event.preventDefault();
  };

  readonly #onDoubleClick = (event: MouseEvent): void => {
    if (!this.#isTouched) this.#pick(event);
  };

  #pick({ clientX, clientY }: MouseEvent): void {
    this.#of.pick(clientX, clientY);
  }

  readonly #onWheel = (event: WheelEvent): void => {
    event.preventDefault();
    this.#perform(wheelOf(event));
  };

  /** The right button pans, so it opens no menu. */
  readonly #onContextMenu = (event: Event): void => {
    if (this.#of.input.pan) event.preventDefault();
  };

  /** Two fingers move the camera, also where one finger scrolls the page; without zoom they are the page's, whose own zoom some people need. */
  readonly #onTouchMove = (event: TouchEvent): void => {
    if (event.touches.length > 1 && event.cancelable && this.#of.input.zoom) event.preventDefault();
  };

  #movePair(from: readonly [Point, Point], to: readonly [Point, Point], height: number): void {
    if (!this.#of.input.zoom) return;
    for (const action of pinchOf(from, to, height)) this.#perform(action);
  }

  /** Passes an action on; false if the page does not allow it. */
  #perform(action: CameraAction): boolean {
    const { zoom, pan } = this.#of.input;
    if ((action.type === 'zoom' && !zoom) || (action.type === 'pan' && !pan)) return false;
    this.#of.act(action);
    return true;
  }
}

/** A CSS touch-action that leaves pinches to the page, too. */
const withPinch = (touchAction: string): string =>
  ['auto', 'manipulation'].includes(touchAction)
    ? touchAction
    : `${touchAction === 'none' ? '' : touchAction} pinch-zoom`.trim();

const positionOf = (event: PointerEvent): Point => ({ x: event.clientX, y: event.clientY });
