import type { ReactiveController, TemplateResult } from 'lit';
import { boxMoves } from '../../viewer/camera/box-points.js';
import type { Feature } from '../../viewer/features.js';
import type { TemplateModel } from '../../viewer/template.js';
import type { Viewer } from '../../viewer/viewer.js';
import { addHandStyles, handsView } from './hands-view.js';
import { PromptController } from './prompt-controller.js';
import { DoubleTap } from '../../viewer/camera/double-tap.js';
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
} from '../../viewer/camera/gestures.js';
import { isWithin, labelParts, scrollsAround } from '../../shared/label-parts.js';

export { AnnouncerController } from './announcer-controller.js';

const LEFT_BUTTON = 0;
const RIGHT_BUTTON = 2;

/** A pressed pointer, and its last position. */
interface Pointer extends Point {
  readonly start: Point;
  readonly pans: boolean;
  /**
   * Receiver of the pointer's moves. It is undecided for a single finger, and for a press on a label, until the pointer
   * moves by `TOUCH_SLOP` pixels.
   */
  readonly owner: 'camera' | 'page' | 'undecided';
  /** Converts CSS pixels of the viewport to those of the element, which CSS may have transformed. */
  readonly inBox: (point: Point) => Point;
}

/** Handles mouse, pen, touch, wheel and keys on the frame and its labels, and converts them to camera actions. */
export class InputController implements ReactiveController, Feature {
  readonly #viewer: Viewer;
  /** Shows visitors that they can move the camera. */
  readonly prompt: PromptController;
  readonly #pointers = new Map<number, Pointer>();
  readonly #doubleTap = new DoubleTap();
  /**
   * Whether the last pressed pointer was a finger. Browsers differ in whether the second of two taps also fires a
   * double click. The two taps must count once.
   */
  #isTouch = false;
  /** Maximum distance of a pointer from the point where it was pressed, CSS pixels. */
  #way = 0;
  /** Whether the last press of the space bar had an effect, so that its repeats are canceled, too. */
  #toggles = false;
  #surface: HTMLElement | null = null;
  #listening: AbortController | undefined;
  #wheel: AbortController | undefined;

  constructor(viewer: Viewer) {
    this.#viewer = viewer;
    this.prompt = new PromptController(viewer);
    viewer.element.addController(this);
    addHandStyles(viewer.element.shadowRoot!);
  }

  advance(now: number): boolean {
    return this.prompt.advance(now);
  }

  touched(): void {
    this.prompt.dismiss();
  }

  view({ canMove }: TemplateModel): TemplateResult {
    const { strings, features } = this.#viewer;
    const kind = !this.prompt.isShown ? 'none' : this.prompt.wiggles ? 'wiggle' : 'basic';
    const keys = canMove ? (features.first('keys') ?? '') : null;
    return handsView({ keys, prompt: kind, onReset: this.#offersReset ? this.#onReset : null, strings });
  }

  /** Whether the reset button is offered: for touch users who have moved the camera, because they have no Home key. */
  get #offersReset(): boolean {
    const { input, isOnShow, camera } = this.#viewer;
    return input.enabled && isOnShow && this.#isTouch && camera.isTouched;
  }

  readonly #onReset = (): void => {
    this.#viewer.act({ type: 'reset' });
    // The button is removed.
    this.#viewer.element.focus({ preventScroll: true });
  };

  hostConnected(): void {
    this.hostUpdated();
  }

  hostUpdated(): void {
    this.#surface = this.#viewer.surface;
    const layer = this.#viewer.slotLayer;
    if (this.#surface === null || layer === null) return;
    const { enabled, zoom, wheel, touchAction } = this.#viewer.input;
    const targets = [this.#surface, layer];
    for (const { style } of targets) style.touchAction = !enabled ? '' : zoom ? touchAction : withPinch(touchAction);
    if (!enabled) setSelectable(layer, true);
    // Lit updates the element once more after its removal. A document listener that is added then would leak the
    // element.
    if (!enabled || !this.#surface.isConnected) return this.hostDisconnected();
    this.#listening ??= this.#listen(this.#surface, targets);
    // A wheel listener that may prevent scrolling slows the page, so there is one only if the wheel zooms.
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

  hostDisconnected(): void {
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
    if (isTouch !== this.#isTouch) this.#viewer.element.requestUpdate();
    this.#isTouch = isTouch;
    if (isTouch && !isOnLabel) this.#doubleTap.down(positionOf(event), event.timeStamp, this.#pointers.size === 0);
    const owner = isTouch || isOnLabel ? 'undecided' : 'camera';
    const start = positionOf(event);
    const inBox = boxMoves(this.#surface!, start);
    this.#pointers.set(event.pointerId, { ...start, start, pans, owner, inBox });
    // If the surface captured the pointer, the pressed label would never get its click event.
    if (!isOnLabel) this.#capture(event.pointerId);
  };

  /** Returns whether a press on a label may move the camera. If not, the press may select text of the label. */
  #takesFromLabel(event: PointerEvent): boolean {
    const own = event.button === RIGHT_BUTTON ? labelParts.withMenu : labelParts.dragged;
    const takes = !event.defaultPrevented && !isWithin(event, own);
    setSelectable(event.currentTarget as HTMLElement, !takes);
    return takes;
  }

  /** Captures a pointer, so that its drag continues outside the element. */
  #capture(pointerId: number): void {
    try {
      this.#surface?.setPointerCapture(pointerId);
    } catch {
      // The pointer has been released already, or is synthetic. Its moves then arrive only over the element.
    }
  }

  readonly #onMove = (event: PointerEvent): void => {
    const from = this.#pointers.get(event.pointerId);
    const height = this.#surface?.clientHeight ?? 0;
    // A mouse without pressed buttons was released while a dialog or a menu of the browser was open, which is not
    // reported.
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
    // A canceled move keeps a surrounding carousel from dragging. The browser itself has no default action for moves.
    for (const action of actions) if (this.#perform(action)) event.preventDefault();
  }

  /**
   * Decides the owner of an undecided pointer once it has moved by `TOUCH_SLOP` pixels. The drag starts at this
   * position, so that the camera does not jump.
   */
  #decide({ pointerId, pointerType }: PointerEvent, from: Pointer, to: Point): void {
    if (Math.hypot(to.x - from.x, to.y - from.y) < TOUCH_SLOP) return;
    const isCamera = pointerType !== 'touch' || isCameraDrag(this.#viewer.input.touchAction, from, to);
    this.#pointers.set(pointerId, { ...from, ...to, owner: isCamera ? 'camera' : 'page' });
    if (isCamera) this.#capture(pointerId);
  }

  readonly #onUp = (event: PointerEvent): void => {
    // A finger is captured by the label that it touches, until the surface captures it for a drag.
    if (event.type === 'lostpointercapture' && event.target !== this.#surface) return;
    const wasDown = this.#pointers.delete(event.pointerId);
    if (!wasDown || event.pointerType !== 'touch') return;
    if (event.type !== 'pointerup') this.#doubleTap.cancel();
    else if (this.#doubleTap.up(positionOf(event), event.timeStamp)) this.#pick(event);
  };

  readonly #onKey = (event: KeyboardEvent): void => {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    if (event.key === ' ') {
      // The repeats of a held key must not scroll the page, either.
      this.#toggles = event.repeat ? this.#toggles : this.#viewer.toggleMotion();
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
    if (this.#viewer.input.tap) this.#viewer.pick(clientX, clientY);
  }

  /**
   * Cancels the click at the end of a drag, because the scene may be inside a link. Clicks by keys and by assistive
   * technology end no drag; their `detail` is 0. Drags with the right button or with a finger end without a click.
   */
  readonly #onClick = (event: MouseEvent): void => {
    if (this.#way > TOUCH_SLOP && event.detail > 0) {
      event.preventDefault();
      event.stopImmediatePropagation();
    }
    this.#way = 0;
  };

  /** Cancels the browser's dragging of a link or an image, which would end the drag of the camera. */
  readonly #onDragStart = (event: Event): void => {
    if (this.#pointers.size > 0) event.preventDefault();
  };

  /**
   * Zooms by the wheel. At the limit of the zoom the page scrolls instead. With Ctrl the browser would zoom the page,
   * so the event is always canceled.
   */
  readonly #onWheel = (event: WheelEvent): void => {
    if (!this.#wheelZooms(event)) return;
    if (this.#viewer.act(wheelOf(event)) || event.ctrlKey) event.preventDefault();
  };

  #wheelZooms(event: WheelEvent): boolean {
    const { wheel } = this.#viewer.input;
    if (isWithin(event, labelParts.panel)) return false;
    // Movements to the side scroll a carousel. Touchpads also report a small vertical part of them.
    if (!event.ctrlKey && Math.abs(event.deltaX) > Math.abs(event.deltaY)) return false;
    if (event.ctrlKey || event.metaKey || wheel === 'always') return true;
    if (wheel !== 'auto') return false;
    // A label may contain a scrollable box, which the wheel then scrolls.
    if (event.currentTarget !== this.#surface && scrollsAround(event.target as Element, this.#viewer.element))
      return false;
    return this.#viewer.element.matches(':focus-within') || !scrollsAround(this.#viewer.element);
  }

  /**
   * Cancels the context menu, because the right button pans. A label with content to copy, save or follow keeps its
   * menu.
   */
  readonly #onContextMenu = (event: Event): void => {
    if (this.#viewer.input.pan && !isWithin(event, labelParts.withMenu)) event.preventDefault();
  };

  /**
   * Keeps two fingers for the camera, even if one finger scrolls the page. If the element does not zoom, two fingers
   * are left to the page, because some visitors need the browser's zoom.
   */
  readonly #onTouchMove = (event: TouchEvent): void => {
    if (event.touches.length < 2 || !event.cancelable || isWithin(event, labelParts.panel)) return;
    if (this.#viewer.input.zoom) event.preventDefault();
  };

  #ofPair(from: readonly [Point, Point], to: readonly [Point, Point], height: number): readonly CameraAction[] {
    return this.#viewer.input.zoom ? pinchOf(from, to, height) : [];
  }

  /** Passes an action to the host. Returns false if the page does not allow it. */
  #perform(action: CameraAction): boolean {
    const { zoom, pan } = this.#viewer.input;
    if ((action.type === 'zoom' && !zoom) || (action.type === 'pan' && !pan)) return false;
    this.#viewer.act(action);
    return true;
  }
}

/** Returns a CSS `touch-action` that also leaves pinches to the page. */
const withPinch = (touchAction: string): string =>
  ['auto', 'manipulation'].includes(touchAction)
    ? touchAction
    : `${touchAction === 'none' ? '' : touchAction} pinch-zoom`.trim();

const setSelectable = ({ style }: HTMLElement, isSelectable: boolean): void => {
  style.userSelect = style.webkitUserSelect = isSelectable ? '' : 'none';
};

const positionOf = (event: PointerEvent): Point => ({ x: event.clientX, y: event.clientY });
