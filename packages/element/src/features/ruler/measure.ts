import type { Camera, Vector3 } from '@gaussian-splat/core';
import { css, type ReactiveController, type ReactiveControllerHost } from 'lit';
import { buttonBarOf } from '../../viewer/button-bar.js';
import { project } from '../../viewer/camera/projection.js';
import { toScene } from '../../viewer/camera/orbit.js';
import type { PickedPoint } from '../../viewer/camera/values.js';
import { perpendicularOf } from './perpendicular.js';
import type { Viewer } from '../../viewer/viewer.js';
import { adoptStyles } from '../../viewer/styles.js';
import { languageOf } from '../../viewer/strings.js';
import { unitOf } from '../../viewer/unit.js';
import { edges } from './edges.js';
import type { MeasureDetail } from './row.js';

const WORDS = {
  measure: 'Measure',
  'measure-keys': 'Press Enter to set each end of the ruler; the arrow keys turn the view. Escape puts the ruler away.',
  'measure-first': 'First end set',
  'measure-none': 'No surface here',
  'measure-unclear': 'No clear surface here',
};

const STYLES = css`
  .ruler {
    position: absolute;
    inset: 0;
    width: 100%;
    height: 100%;
    pointer-events: none;
    overflow: hidden;
    color: var(--measure-color, rgb(255 255 255));
  }
  .ruler line {
    stroke: currentcolor;
    stroke-width: 2.5;
    paint-order: stroke;
    filter: drop-shadow(0 0 1px rgb(0 0 0));
  }
  .ruler circle {
    fill: none;
    stroke: currentcolor;
    stroke-width: 2;
    filter: drop-shadow(0 0 1px rgb(0 0 0));
  }
  .ruler-label {
    position: absolute;
    padding: 2px 8px;
    border-radius: 6px;
    pointer-events: none;
    font:
      600 14px / 1.4 system-ui,
      sans-serif;
    font-variant-numeric: tabular-nums;
    white-space: nowrap;
    /* The numbers and their unit keep their order on pages from right to left. */
    direction: ltr;
    color: var(--measure-color, rgb(255 255 255));
    background: var(--measure-background, rgb(0 0 0 / 0.75));
    transform: translate(-50%, -50%);
  }
`;
const SVG = 'http://www.w3.org/2000/svg';
/** Distance between press and release, CSS pixels, from which a movement is a drag and no click. */
const DRAG = 5;
/** Number of significant digits of a length. */
const DIGITS = 3;
/** A ruler: two ends on surfaces of the scene, a line, and its length with its uncertainty. */
export class Measure implements ReactiveController {
  readonly #element: ReactiveControllerHost & HTMLElement;
  readonly #core: Viewer;
  readonly #place: HTMLElement;
  readonly #button: HTMLButtonElement;
  readonly #drawing: SVGSVGElement;
  readonly #label: HTMLElement;
  #ends: readonly PickedPoint[] = [];
  /** URL of the scene that the ends belong to. */
  #url = '';
  #listening: AbortController | undefined;
  #pressed: readonly [number, number] | undefined;
  #hasKeyboard = false;

  constructor(core: Viewer) {
    const { element } = core;
    this.#element = element;
    this.#core = core;
    this.#place = buttonBarOf(core);
    adoptStyles(element.shadowRoot!, STYLES);
    const page = element.ownerDocument;
    this.#button = Object.assign(page.createElement('button'), { type: 'button' });
    this.#button.setAttribute('part', 'measure-button');
    this.#button.addEventListener('click', () => this.#toggle());
    this.#drawing = page.createElementNS(SVG, 'svg');
    this.#drawing.setAttribute('class', 'ruler');
    this.#drawing.setAttribute('aria-hidden', 'true');
    this.#label = page.createElement('div');
    this.#label.className = 'ruler-label';
    this.#label.setAttribute('part', 'measure-label');
    this.#label.setAttribute('aria-hidden', 'true');
    element.addController(this);
  }

  hostUpdated(): void {
    const { attributes, isOnShow, strings, sources } = this.#core;
    if (!attributes.measure || !isOnShow) return this.hostDisconnected();
    const { url } = sources.ownEntry.scene;
    if (url !== this.#url) this.#ends = [];
    this.#url = url;
    if (this.#listening) this.#draw();
    this.#button.textContent = this.#word('measure');
    this.#button.lang = languageOf(strings) ?? '';
    this.#button.setAttribute('aria-pressed', String(this.#listening !== undefined));
    if (!this.#button.isConnected) this.#place.append(this.#button);
  }

  #word(key: keyof typeof WORDS): string {
    return this.#core.strings[key] ?? WORDS[key];
  }

  #say(text: string): void {
    const { value } = this.#core.announcer;
    // Screen readers announce changes only. A space makes a repeated text another one.
    value?.say(text !== '' && text === value.text ? `${text}\u00A0` : text);
  }

  #toggle(): void {
    if (this.#listening) this.#put();
    else this.#take();
    this.#element.requestUpdate();
  }

  #take(): void {
    const { surface } = this.#core;
    if (!surface) return;
    this.#listening = new AbortController();
    const { signal } = this.#listening;
    const on = { signal, capture: true };
    surface.addEventListener('pointerdown', ({ clientX, clientY }) => (this.#pressed = [clientX, clientY]), on);
    surface.addEventListener('click', this.#onClick, on);
    surface.addEventListener('keydown', this.#onKey, on);
    surface.addEventListener('focus', () => this.#draw(), { signal });
    surface.addEventListener('blur', () => this.#draw(), { signal });
    this.#element.addEventListener('camera-change', this.#draw, { signal });
    const observer = new ResizeObserver(() => requestAnimationFrame(this.#draw));
    observer.observe(surface);
    signal.addEventListener('abort', () => observer.disconnect());
    surface.after(this.#drawing, this.#label);
    // Keyboard users set the ends in the center of the image, so the image gets the focus.
    this.#hasKeyboard = this.#button.matches(':focus-visible');
    if (surface.tabIndex < 0) {
      surface.tabIndex = 0;
      signal.addEventListener('abort', () => surface.removeAttribute('tabindex'));
    }
    if (this.#hasKeyboard) surface.focus();
    this.#say(this.#word('measure-keys'));
    this.#draw();
  }

  #put(): void {
    this.#listening?.abort();
    this.#listening = undefined;
    this.#ends = [];
    this.#drawing.remove();
    this.#label.remove();
    this.#say('');
  }

  hostDisconnected(): void {
    this.#button.remove();
    if (this.#listening) this.#put();
  }

  readonly #onClick = (event: MouseEvent): void => {
    const { clientX, clientY } = event;
    const from = this.#pressed ?? [clientX, clientY];
    if (Math.hypot(clientX - from[0], clientY - from[1]) > DRAG) return;
    event.stopImmediatePropagation();
    this.#hasKeyboard = false;
    void this.#setEnd(clientX, clientY);
  };

  readonly #onKey = (event: KeyboardEvent): void => {
    if (event.key === 'Escape') {
      // Otherwise a dialog around the scene would close, too.
      event.preventDefault();
      event.stopImmediatePropagation();
      this.#put();
      this.#element.requestUpdate();
      this.#button.focus();
      return;
    }
    if (!this.#hasKeyboard) {
      this.#hasKeyboard = true;
      this.#draw();
    }
    if (event.key !== 'Enter') return;
    event.preventDefault();
    event.stopImmediatePropagation();
    if (event.repeat) return;
    const { left, top, width, height } = this.#core.surface!.getBoundingClientRect();
    void this.#setEnd(left + width / 2, top + height / 2);
  };

  async #setEnd(clientX: number, clientY: number): Promise<void> {
    const signal = this.#listening?.signal;
    const point = await this.#core.positionFromPoint(clientX, clientY, edges);
    if (!signal || signal.aborted) return;
    if (point === null) return this.#say(this.#word('measure-none'));
    // A third point starts a new measurement.
    this.#ends = this.#ends.length === 1 ? [this.#ends[0], point] : [point];
    this.#draw();
    const measured = this.#measured();
    const unclear = Number.isFinite(point.uncertainty) ? '' : `. ${this.#word('measure-unclear')}`;
    if (!measured) return this.#say(this.#word('measure-first') + unclear);
    this.#say(textOf(measured) + unclear);
    this.#element.dispatchEvent(new CustomEvent('measure', { detail: measured }));
  }

  #measured(): MeasureDetail | undefined {
    const [from, to] = this.#ends;
    if (!to) return undefined;
    const length = Math.hypot(to.x - from.x, to.y - from.y, to.z - from.z);
    const uncertainty = Math.hypot(from.uncertainty, to.uncertainty);
    const unit = unitOf(this.#core);
    const meters = unit === undefined ? null : length * unit;
    return { from, to, length, uncertainty, perpendicular: perpendicularOf(from, to), meters, unit: unit ?? null };
  }

  /** Draws the ruler at the projections of its ends in the last frame. */
  readonly #draw = (): void => {
    const { drawnFrom: camera, surface, frame } = this.#core;
    this.#drawing.replaceChildren();
    this.#label.hidden = true;
    if (!camera || !surface) return;
    const [width, height] = [surface.clientWidth, surface.clientHeight];
    if (this.#hasKeyboard && surface.matches(':focus')) this.#add('circle', { cx: width / 2, cy: height / 2, r: 10 });
    const places = this.#ends.map(({ x, y, z }) => toScene(frame, [x, y, z]));
    const inBox = (point: Vector3): readonly [number, number] => {
      const at = project(camera, point);
      return [(at.x * width) / camera.width, (at.y * height) / camera.height];
    };
    for (const place of places) {
      if (!isAhead(camera, place)) continue;
      const [cx, cy] = inBox(place);
      this.#add('circle', { cx, cy, r: 4 });
    }
    const line = shownPart(camera, places)?.map(inBox);
    if (!line) return;
    const [[x1, y1], [x2, y2]] = line;
    this.#add('line', { x1, y1, x2, y2 });
    const measured = this.#measured();
    if (!measured) return;
    this.#label.hidden = false;
    this.#label.textContent = textOf(measured);
    // The middle of the line, or of its visible end.
    const within = (at: number, size: number, margin: number): number =>
      Math.max(Math.min(margin, size / 2), Math.min(size - margin, at));
    const [x, y] = [
      (within(x1, width, 0) + within(x2, width, 0)) / 2,
      (within(y1, height, 0) + within(y2, height, 0)) / 2,
    ];
    this.#label.style.left = `${within(x, width, this.#label.offsetWidth / 2)}px`;
    this.#label.style.top = `${within(y - 18, height, this.#label.offsetHeight / 2)}px`;
  };

  #add(name: string, attributes: Readonly<Record<string, number>>): void {
    const shape = this.#element.ownerDocument.createElementNS(SVG, name);
    for (const [key, value] of Object.entries(attributes)) shape.setAttribute(key, value.toFixed(1));
    this.#drawing.append(shape);
  }
}

const isAhead = (camera: Camera, point: Vector3): boolean => project(camera, point).depth > 0;

/** Returns the ends of the part of a line that is before the camera; undefined if none is. */
function shownPart(camera: Camera, [a, b]: readonly Vector3[]): readonly [Vector3, Vector3] | undefined {
  if (!b) return undefined;
  const [from, to] = [a, b].map((point) => project(camera, point).depth);
  if (from <= 0 && to <= 0) return undefined;
  // A point just before the eye is far outside the image.
  const cut = 0.01 * Math.max(from, to);
  const at = (share: number): Vector3 => [0, 1, 2].map((k) => a[k] + share * (b[k] - a[k])) as unknown as Vector3;
  const crossing = (): Vector3 => at((cut - from) / (to - from));
  return [from < cut ? crossing() : a, to < cut ? crossing() : b];
}

/**
 * Returns a text such as `1.24 m ± 0.01 m`, both numbers with the same decimals, and the distance of parallel surfaces,
 * such as `⊥ 1.20 m`, if it differs by more than the uncertainty. If `unit` is null, the numbers are in units of the scene
 * and have no suffix.
 */
function textOf({ length, uncertainty, perpendicular, unit }: MeasureDetail): string {
  const factor = unit ?? 1;
  const suffix = unit === null ? '' : ' m';
  const value = length * factor;
  const decimals = Math.max(0, DIGITS - 1 - Math.floor(Math.log10(Math.max(value, 1e-3))));
  const number = (each: number): string => `${each.toFixed(decimals)}${suffix}`;
  const off = Number.isFinite(uncertainty) ? number(Math.max(uncertainty * factor, 10 ** -decimals)) : '?';
  const isOblique = perpendicular !== null && length - perpendicular > uncertainty && length > 0;
  // Two points of one surface have no distance at right angles to it.
  const isApart = isOblique && perpendicular > uncertainty;
  return `${number(value)} ± ${off}${isApart ? ` · ⊥ ${number(perpendicular * factor)}` : ''}`;
}
