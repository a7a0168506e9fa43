/**
 * Dispatches clicks and pointer moves to children. The module is loaded when a child of an element is `interactive`.
 */
import { boundsOfWorld } from '@gaussian-splat/renderer/tools';
import { css } from 'lit';
import { project } from '../../viewer/camera/projection.js';
import type { PickedPoint } from '../../viewer/camera/values.js';
import { adoptStyles } from '../../viewer/styles.js';
import { word } from '../../viewer/strings.js';
import type { Viewer } from '../../viewer/viewer.js';
import { SplatChild } from './child.js';

/** A click or pointer event on a child, analogous to the browser's events on HTML elements. */
export class ScenePointerEvent extends PointerEvent {
  /** The picked point of the scene; null for a click by key, and if the pointer is over no splat or mesh. */
  readonly hit: PickedPoint | null;

  constructor(type: string, init: PointerEventInit, hit: PickedPoint | null) {
    super(type, init);
    this.hit = hit;
  }
}

/**
 * Minimum pause after a pick under a moving pointer, ms, and the minimum pause as a multiple of the duration of the
 * pick.
 */
const [HOVER_MS, HOVER_SHARE] = [60, 3];
/** Margin of the focus outline around a child, CSS pixels, because bounds contain only the centers of splats. */
const MARGIN = 12;

const STYLES = css`
  .children {
    position: absolute;
    inset: 0;
    overflow: hidden;
    pointer-events: none;
  }
  [part='scene-button'] {
    position: absolute;
    padding: 0;
    border: 0;
    background: none;
    pointer-events: none;
  }
  [part='scene-button']:focus-visible {
    outline: 2px solid var(--scene-focus-color, highlight);
    outline-offset: 2px;
    box-shadow: 0 0 0 2px rgb(255 255 255 / 0.8);
  }
`;

/**
 * Dispatches clicks and pointer moves to children. A click on the frame is delayed until the GPU has picked the point.
 * It is then dispatched once, to the child or to the element itself. For keyboards, each child has a button, which
 * ignores pointers.
 */
export class Interaction {
  readonly #of: Viewer;
  readonly #layer: HTMLElement;
  readonly #buttons = new Map<SplatChild, HTMLButtonElement>();
  #surface: HTMLElement | undefined;
  #over: SplatChild | null = null;
  /** The latest pointer move for which no pick has started; undefined if there is none. */
  #moved: PointerEvent | undefined;
  #isLooking = false;

  constructor(of: Viewer) {
    this.#of = of;
    const { element } = of;
    adoptStyles(element.shadowRoot!, STYLES);
    this.#layer = element.ownerDocument.createElement('div');
    this.#layer.className = 'children';
    new MutationObserver(() => this.update()).observe(element, {
      ...{ childList: true, subtree: true },
      attributeFilter: ['aria-label', 'title', 'lang'],
    });
    element.addEventListener('camera-change', () => this.#placeFocused());
    // The event `load` of children does not bubble.
    element.addEventListener('load', () => this.update(), { capture: true });
    element.addController({ hostUpdated: () => this.update() });
    this.update();
  }

  get #children(): SplatChild[] {
    return [...this.#of.element.children].filter(
      (child): child is SplatChild => child instanceof SplatChild && child.interactive && !child.hidden,
    );
  }

  /** Updates the buttons of the children. Call when children or their attributes have changed. */
  update(): void {
    const { surface } = this.#of;
    if (surface === null) return;
    if (surface !== this.#surface) this.#listen(surface);
    const children = this.#children;
    for (const [child, button] of this.#buttons) {
      if (children.includes(child)) continue;
      button.remove();
      this.#buttons.delete(child);
      if (child === this.#over) this.#setOver(null, undefined, null);
    }
    children.forEach((child, i) => {
      const button = this.#buttonOf(child);
      button.hidden = !this.#of.isOnShow || !child.loaded;
      button.ariaLabel = child.ariaLabel || child.title || word(this.#of.strings, 'scene');
      button.lang = child.lang;
      if (this.#layer.children[i] !== button) this.#layer.insertBefore(button, this.#layer.children[i] ?? null);
    });
  }

  #listen(surface: HTMLElement): void {
    this.#surface = surface;
    surface.after(this.#layer);
    // Clicks that belong to dragging or measuring do not arrive here: that code stops them in the capturing phase.
    // Walking follows those that are dispatched to the element.
    surface.addEventListener('click', (event) => void this.#onClick(event));
    surface.addEventListener('pointermove', (event) => this.#onMove(event));
    surface.addEventListener('pointerleave', (event) => {
      this.#moved = undefined;
      this.#setOver(null, event, null);
    });
  }

  #buttonOf(child: SplatChild): HTMLButtonElement {
    const known = this.#buttons.get(child);
    if (known) return known;
    const button = Object.assign(this.#of.element.ownerDocument.createElement('button'), { type: 'button' });
    button.setAttribute('part', 'scene-button');
    button.addEventListener('click', (event) => {
      event.stopPropagation();
      child.dispatchEvent(new ScenePointerEvent('click', { ...BUBBLES, detail: event.detail }, null));
    });
    for (const [type, also] of [
      ['focus', 'focusin'],
      ['blur', 'focusout'],
    ]) {
      button.addEventListener(type, () => {
        this.#place(child, button);
        child.dispatchEvent(new FocusEvent(type));
        child.dispatchEvent(new FocusEvent(also, { bubbles: true }));
      });
    }
    this.#buttons.set(child, button);
    return button;
  }

  async #onClick(event: MouseEvent): Promise<void> {
    if (this.#children.length === 0) return;
    event.stopImmediatePropagation();
    event.preventDefault();
    const hit = await this.#look(event);
    const target = this.#childOf(hit) ?? this.#of.element;
    target.dispatchEvent(new ScenePointerEvent('click', initOf(event), hit));
  }

  #onMove(event: PointerEvent): void {
    // Fingers do not hover, and moves with a pressed button are drags.
    if (event.pointerType === 'touch' || event.buttons !== 0 || this.#children.length === 0) return;
    this.#moved = event;
    if (!this.#isLooking) void this.#follow();
  }

  /** Picks under the pointer while it moves, with pauses that leave the GPU time for frames. */
  async #follow(): Promise<void> {
    this.#isLooking = true;
    while (this.#moved) {
      const event = this.#moved;
      this.#moved = undefined;
      const begin = performance.now();
      const hit = await this.#look(event);
      // If the pointer has left during the pick, it hovers over nothing.
      if (this.#surface?.matches(':hover') !== false) this.#setOver(this.#childOf(hit), event, hit);
      const took = performance.now() - begin;
      await new Promise((resolve) => setTimeout(resolve, Math.max(HOVER_MS, HOVER_SHARE * took)));
    }
    this.#isLooking = false;
  }

  /** Returns the picked point under a pointer; null if there is none, or the device is lost. */
  #look({ clientX, clientY }: MouseEvent): Promise<PickedPoint | null> {
    return this.#of.positionFromPoint(clientX, clientY).catch(() => null);
  }

  #childOf(hit: PickedPoint | null): SplatChild | null {
    return this.#children.find((child) => child === hit?.element) ?? null;
  }

  #setOver(child: SplatChild | null, event: PointerEvent | undefined, hit: PickedPoint | null): void {
    const before = this.#over;
    if (child === before) return;
    this.#over = child;
    if (this.#surface) this.#surface.style.cursor = child ? child.style.cursor || 'pointer' : '';
    const notify = (target: SplatChild | null, types: readonly [string, string], relatedTarget: Element): void => {
      const init = { ...(event ? initOf(event) : BUBBLES), relatedTarget, cancelable: false };
      types.forEach((type, i) =>
        target?.dispatchEvent(new ScenePointerEvent(type, { ...init, bubbles: i === 0 }, hit)),
      );
    };
    notify(before, ['pointerout', 'pointerleave'], child ?? this.#of.element);
    notify(child, ['pointerover', 'pointerenter'], before ?? this.#of.element);
  }

  #placeFocused(): void {
    for (const [child, button] of this.#buttons) if (button.matches(':focus')) this.#place(child, button);
  }

  /**
   * Positions the button of a child around the child's bounds in the last frame, so that the outline of the button
   * shows the keyboard focus.
   */
  #place(child: SplatChild, button: HTMLButtonElement): void {
    const { drawnFrom: camera, surface } = this.#of;
    const placement = child.entry.member?.placement;
    const bounds = placement && boundsOfWorld({ placements: [placement] });
    if (!camera || !bounds || !surface) return;
    const corners = Array.from({ length: 8 }, (_, k) => {
      const side = (axis: number): number => (k & (1 << axis) ? bounds.max : bounds.min)[axis];
      return project(camera, [side(0), side(1), side(2)]);
    });
    // If a corner is behind the camera, the outline is that of the frame.
    const isAround = corners.some(({ depth }) => depth <= 0);
    const range = (of: 'x' | 'y', size: number): [number, number] => {
      const share = (value: number): number => Math.min(1, Math.max(0, value / size));
      const all = corners.map((corner) => corner[of]);
      return isAround ? [0, 1] : [share(Math.min(...all)), share(Math.max(...all))];
    };
    const [left, right] = range('x', camera.width);
    const [top, bottom] = range('y', camera.height);
    const length = (share: number, px: number): string => `calc(${(100 * share).toFixed(2)}% + ${px}px)`;
    const box = { left: length(left, -MARGIN), top: length(top, -MARGIN) };
    Object.assign(box, { width: length(right - left, 2 * MARGIN), height: length(bottom - top, 2 * MARGIN) });
    Object.assign(button.style, box);
  }
}

const BUBBLES = { bubbles: true, composed: true, cancelable: true } as const;

/** Returns the initial values of an event with the pointer and the modifier keys of another event. */
function initOf(event: MouseEvent): PointerEventInit {
  const { clientX, clientY, screenX, screenY, button, buttons, detail, view } = event;
  const { ctrlKey, shiftKey, altKey, metaKey } = event;
  const { pointerId, pointerType, isPrimary } = event as PointerEvent;
  const pointer = pointerType === undefined ? {} : { pointerId, pointerType, isPrimary };
  const place = { clientX, clientY, screenX, screenY, button, buttons, detail, view };
  return { ...BUBBLES, ...place, ctrlKey, shiftKey, altKey, metaKey, ...pointer };
}
