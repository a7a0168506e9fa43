import type { ReactiveController, ReactiveControllerHost } from 'lit';
import type { WheelZoom } from '../attributes.js';
import { boxMoves } from '../camera/box-points.js';
import { addHandStyles } from '../hands-view.js';
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
import { isWithin, labelParts, scrollsAround } from './label-parts.js';

export { handsView } from '../hands-view.js';
export { AnnouncerController } from './announcer-controller.js';
export { PromptController } from './prompt-controller.js';

/** Allowed interactions. */
export interface InputOptions {
  readonly enabled: boolean;
  readonly zoom: boolean;
  readonly pan: boolean;
  /** Whether double clicks and double taps have an effect. */
  readonly tap: boolean;
  /** When the wheel zooms. */
  readonly wheel: WheelZoom;
  /** CSS touch-action of the frame: one-finger gestures that are left to the page. */
  readonly touchAction: string;
}

/** Receiver of the input. */
export interface InputHost {
  /** The element for dragging and focus, once it is rendered. */
  readonly surface: HTMLElement | null;
  /** Holds the labels of the page, on which a drag may begin. */
  readonly hotspotLayer: HTMLElement | null;
  /** Read after every update of the element. */
  readonly input: InputOptions;
  /** @returns False if it has no effect. */
  act(action: CameraAction): boolean;
  /** Called for a double click or a double tap, in CSS pixels of the page. */
  pick(clientX: number, clientY: number): void;
  /** Called for the space bar; returns false if it has no effect. */
  toggleMotion(): boolean;
}

const LEFT_BUTTON = 0;
const RIGHT_BUTTON = 2;

/** A pressed pointer on the frame. */
interface Pointer extends Point {
  readonly start: Point;
  readonly pans: boolean;
  /** Owner of its moves: for one finger, and for a press on a label, it is undecided until the pointer moves. */
  readonly owner: 'camera' | 'page' | 'undecided';
  /** Converts CSS pixels of the page to those of the element, which CSS may have transformed. */
  readonly inBox: (point: Point) => Point;
}

/** Handles mouse, pen, touch, wheel and keys on the frame and its labels, and converts them to camera actions. */
export class InputController implements ReactiveController {
  readonly #host: ReactiveControllerHost & HTMLElement;
  readonly #of: InputHost;
  readonly #pointers = new Map<number, Pointer>();
  readonly #doubleTap = new DoubleTap();
  /**
   * Whether the last pointer was a finger: browsers differ in whether its second tap is also a double click, which must
   * count once.
   */
  #isTouch = false;
  /** Distance in CSS pixels of a pointer from its press. */
  #way = 0;
  /** Whether the space bar had an effect when it was pressed. */
  #toggles = false;
  #surface: HTMLElement | null = null;
  #listening: AbortController | undefined;
  #wheel: AbortController | undefined;

  constructor(host: ReactiveControllerHost & HTMLElement, of: InputHost) {
    this.#host = host;
    this.#of = of;
    host.addController(this);
    addHandStyles(host.shadowRoot!);
  }

  /** Whether the last pressed pointer was a finger. */
  get isTouch(): boolean {
    return this.#isTouch;
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
    const layer = this.#of.hotspotLayer;
    if (this.#surface === null || layer === null) return;
    const { enabled, zoom, wheel, touchAction } = this.#of.input;
    const targets = [this.#surface, layer];
    for (const { style } of targets) style.touchAction = !enabled ? '' : zoom ? touchAction : withPinch(touchAction);
    if (!enabled) setSelectable(layer, true);
    // Lit updates once more after removal. A document listener added then would leak the element.
    if (!enabled || !this.#surface.isConnected) return this.#stop();
    this.#listening ??= this.#listen(this.#surface, targets);
    // A wheel listener that may prevent scrolling slows the page, so it exists only if the wheel zooms.
    if (zoom && wheel !== 'none') this.#wheel ??= this.#listenToWheel(targets);
    else this.#stopWheel();
  }

  #listen(surface: HTMLElement, targets: readonly HTMLElement[]): AbortController {
    const listening = new AbortController();
    const { signal } = listening;
    for (const target of targets) {
      target.addEventListener('pointerdown', this.#onDown, { signal });
      target.addEventListener('pointermove', this.#onMove, { signal });
      for (const type of ['pointerup', 'pointercancel', 'lostpointercapture'] as const) {
        target.addEventListener(type, this.#onUp, { signal });
      }
      target.addEventListener('click', this.#onClick, { signal, capture: true });
      target.addEventListener('contextmenu', this.#onContextMenu, { signal });
      target.addEventListener('touchmove', this.#onTouchMove, { signal, passive: false });
    }
    surface.addEventListener('keydown', this.#onKey, { signal });
    surface.addEventListener('dblclick', this.#onDoubleClick, { signal });
    surface.ownerDocument.addEventListener('dragstart', this.#onDragStart, { signal });
    return listening;
  }

  #listenToWheel(targets: readonly HTMLElement[]): AbortController {
    const listening = new AbortController();
    const options = { signal: listening.signal, passive: false };
    for (const target of targets) target.addEventListener('wheel', this.#onWheel, options);
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
    if (this.#pointers.size === 0) this.#way = 0;
    const isOnLabel = event.currentTarget !== this.#surface;
    if (isOnLabel && !this.#takesFromLabel(event)) return;
    const pans = event.button === RIGHT_BUTTON || event.shiftKey || event.ctrlKey || event.metaKey;
    const isTouch = event.pointerType === 'touch';
    if (isTouch !== this.#isTouch) this.#host.requestUpdate();
    this.#isTouch = isTouch;
    if (isTouch && !isOnLabel) this.#doubleTap.down(positionOf(event), event.timeStamp, this.#pointers.size === 0);
    const owner = isTouch || isOnLabel ? 'undecided' : 'camera';
    const start = positionOf(event);
    const inBox = boxMoves(this.#surface!, start);
    this.#pointers.set(event.pointerId, { ...start, start, pans, owner, inBox });
    // A label with a captured pointer would never get its click event.
    if (!isOnLabel) this.#capture(event.pointerId);
  };

  /** Whether a press on a label may move the camera: all others may select text. */
  #takesFromLabel(event: PointerEvent): boolean {
    const own = event.button === RIGHT_BUTTON ? labelParts.withMenu : labelParts.dragged;
    const takes = !event.defaultPrevented && !isWithin(event, own);
    setSelectable(event.currentTarget as HTMLElement, !takes);
    return takes;
  }

  /** Continues a drag outside the element. */
  #capture(pointerId: number): void {
    try {
      this.#surface?.setPointerCapture(pointerId);
    } catch {
      // The pointer is gone already, or synthetic; then moves arrive only over the element.
    }
  }

  readonly #onMove = (event: PointerEvent): void => {
    const from = this.#pointers.get(event.pointerId);
    const height = this.#surface?.clientHeight ?? 0;
    // If a dialog or a menu of the browser was open, the release of the button was not reported.
    if (event.buttons === 0 && event.pointerType === 'mouse') this.#pointers.delete(event.pointerId);
    else if (from !== undefined && height > 0) this.#follow(event, from, height);
  };

  #follow(event: PointerEvent, from: Pointer, height: number): void {
    const to = positionOf(event);
    this.#way = Math.max(this.#way, Math.hypot(to.x - from.start.x, to.y - from.start.y));
    const other = [...this.#pointers].find(([id]) => id !== event.pointerId)?.[1];
    if (!other && from.owner === 'undecided') return this.#decide(event, from, to);
    this.#pointers.set(event.pointerId, { ...from, ...to });
    const { inBox } = from;
    const [start, end] = [inBox(from), inBox(to)];
    const actions = other
      ? this.#ofPair([start, inBox(other)], [end, inBox(other)], height)
      : from.owner === 'camera'
        ? [from.pans ? panOf(start, end, height) : orbitOf(start, end, height)]
        : [];
    // Prevents a surrounding carousel from dragging. The browser has no default action for a move.
    for (const action of actions) if (this.#perform(action)) event.preventDefault();
  }

  /** Decides the owner of a finger; its drag counts from here on, so that the camera does not jump. */
  #decide({ pointerId, pointerType }: PointerEvent, from: Pointer, to: Point): void {
    if (Math.hypot(to.x - from.x, to.y - from.y) < TOUCH_SLOP) return;
    const isCamera = pointerType !== 'touch' || isCameraDrag(this.#of.input.touchAction, from, to);
    this.#pointers.set(pointerId, { ...from, ...to, owner: isCamera ? 'camera' : 'page' });
    if (isCamera) this.#capture(pointerId);
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
      // A held key must not scroll the page, either.
      this.#toggles = event.repeat ? this.#toggles : this.#of.toggleMotion();
      if (this.#toggles) event.preventDefault();
      return;
    }
    const action = keyOf(event.key, event.shiftKey);
    if (action !== null && this.#perform(action)) event.preventDefault();
  };

  readonly #onDoubleClick = (event: MouseEvent): void => {
    if (!this.#isTouch) this.#pick(event);
  };

  #pick({ clientX, clientY }: MouseEvent): void {
    if (this.#of.input.tap) this.#of.pick(clientX, clientY);
  }

  /** The end of a drag is not a click, because the scene may be inside a link. */
  readonly #onClick = (event: Event): void => {
    if (this.#way > TOUCH_SLOP) {
      event.preventDefault();
      event.stopImmediatePropagation();
    }
    this.#way = 0;
  };

  /** The browser's own dragging of a link or an image would end the camera's. */
  readonly #onDragStart = (event: Event): void => {
    if (this.#pointers.size > 0) event.preventDefault();
  };

  /** At the limit the page scrolls. With Ctrl the browser would zoom instead, so that is prevented. */
  readonly #onWheel = (event: WheelEvent): void => {
    if (!this.#wheelZooms(event)) return;
    if (this.#of.act(wheelOf(event)) || event.ctrlKey) event.preventDefault();
  };

  #wheelZooms(event: WheelEvent): boolean {
    const { wheel } = this.#of.input;
    if (isWithin(event, labelParts.panel)) return false;
    if (event.ctrlKey || event.metaKey || wheel === 'always') return true;
    if (wheel !== 'auto') return false;
    // A label may have its own scrollable box.
    if (event.currentTarget !== this.#surface && scrollsAround(event.target as Element, this.#host)) return false;
    return this.#host.matches(':focus-within') || !scrollsAround(this.#host);
  }

  /** The right button pans, so it opens no menu except on a label with content to copy, save or follow. */
  readonly #onContextMenu = (event: Event): void => {
    if (this.#of.input.pan && !isWithin(event, labelParts.withMenu)) event.preventDefault();
  };

  /**
   * Two fingers move the camera, even if one finger scrolls the page; without zoom they are left to the page, because
   * some visitors need its zoom.
   */
  readonly #onTouchMove = (event: TouchEvent): void => {
    if (event.touches.length < 2 || !event.cancelable || isWithin(event, labelParts.panel)) return;
    if (this.#of.input.zoom) event.preventDefault();
  };

  #ofPair(from: readonly [Point, Point], to: readonly [Point, Point], height: number): readonly CameraAction[] {
    return this.#of.input.zoom ? pinchOf(from, to, height) : [];
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

const setSelectable = ({ style }: HTMLElement, isSelectable: boolean): void => {
  style.userSelect = style.webkitUserSelect = isSelectable ? '' : 'none';
};

const positionOf = (event: PointerEvent): Point => ({ x: event.clientX, y: event.clientY });
