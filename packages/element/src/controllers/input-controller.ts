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

/** What people may do. */
export interface InputOptions {
  readonly enabled: boolean;
  readonly zoom: boolean;
  readonly pan: boolean;
  /** A double click or a double tap means something. */
  readonly tap: boolean;
  /** When the wheel zooms. */
  readonly wheel: WheelZoom;
  /** CSS touch-action of the picture: which one-finger moves stay the page's. */
  readonly touchAction: string;
}

/** Who hears of it. */
export interface InputHost {
  /** The element that is dragged and focused, once it is rendered. */
  readonly surface: HTMLElement | null;
  /** Holds the labels of the page, on which a drag may begin. */
  readonly hotspotLayer: HTMLElement | null;
  /** Read after every update of the element. */
  readonly input: InputOptions;
  /** @returns false where it moves nothing */
  act(action: CameraAction): boolean;
  /** A double click or a double tap, in CSS pixels of the page. */
  pick(clientX: number, clientY: number): void;
  /** The space bar; false if it means nothing here. */
  toggleMotion(): boolean;
}

const LEFT_BUTTON = 0;
const RIGHT_BUTTON = 2;

/** A pointer that is down on the picture. */
interface Pointer extends Point {
  readonly start: Point;
  readonly pans: boolean;
  /** Whose its moves are: of one finger, and of what begins on a label, this is known only once it has set out. */
  readonly owner: 'camera' | 'page' | 'undecided';
  /** From CSS pixels of the page to those of the element, which CSS may have turned. */
  readonly inBox: (point: Point) => Point;
}

/** Listens to mouse, pen, touch, wheel and keys on the picture and its labels, and turns them into camera actions. */
export class InputController implements ReactiveController {
  readonly #host: ReactiveControllerHost & HTMLElement;
  readonly #of: InputHost;
  readonly #pointers = new Map<number, Pointer>();
  readonly #doubleTap = new DoubleTap();
  /** The last pointer was a finger: whether its second tap is a double click, too, differs from browser to browser, and it counts once. */
  #isTouch = false;
  /** CSS pixels that a pointer has gone from where it came down. */
  #way = 0;
  /** The space bar meant something when it was pressed. */
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

  /** The last pointer that came down was a finger. */
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
    // An element that has left the page is updated once more; the listener of its document would keep it for good.
    if (!enabled || !this.#surface.isConnected) return this.#stop();
    this.#listening ??= this.#listen(this.#surface, targets);
    // A wheel listener that may prevent scrolling costs the page; it exists only where the wheel zooms.
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
    // A label whose pointer is captured would never hear of its click.
    if (!isOnLabel) this.#capture(event.pointerId);
  };

  /** Whether the camera may have a pointer that comes down on a label: only what it may not have selects text. */
  #takesFromLabel(event: PointerEvent): boolean {
    const own = event.button === RIGHT_BUTTON ? labelParts.withMenu : labelParts.dragged;
    const takes = !event.defaultPrevented && !isWithin(event, own);
    setSelectable(event.currentTarget as HTMLElement, !takes);
    return takes;
  }

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
    // A carousel around the scene learns so that the drag is not its own. The browser does nothing by itself on a move.
    for (const action of actions) if (this.#perform(action)) event.preventDefault();
  }

  /** Finds out whose a finger is; its drag counts from here on, so that the camera does not jump. */
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
      // Held down it scrolls no page, either.
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

  /** What ends a drag is no click: around the scene there may be a link. */
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

  /** At the limit the page scrolls. With Ctrl it would zoom, which nobody has asked for. */
  readonly #onWheel = (event: WheelEvent): void => {
    if (!this.#wheelZooms(event)) return;
    if (this.#of.act(wheelOf(event)) || event.ctrlKey) event.preventDefault();
  };

  #wheelZooms(event: WheelEvent): boolean {
    const { wheel } = this.#of.input;
    if (isWithin(event, labelParts.panel)) return false;
    if (event.ctrlKey || event.metaKey || wheel === 'always') return true;
    if (wheel !== 'auto') return false;
    // A label may have a box of its own to scroll.
    if (event.currentTarget !== this.#surface && scrollsAround(event.target as Element, this.#host)) return false;
    return this.#host.matches(':focus-within') || !scrollsAround(this.#host);
  }

  /** The right button pans, so it opens no menu but where a label has something to copy, to save or to follow. */
  readonly #onContextMenu = (event: Event): void => {
    if (this.#of.input.pan && !isWithin(event, labelParts.withMenu)) event.preventDefault();
  };

  /** Two fingers move the camera, also where one finger scrolls the page; without zoom they are the page's, whose own zoom some people need. */
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
