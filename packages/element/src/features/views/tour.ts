import { bytesOf, fetchPatiently } from '@gaussian-splat/core/fetch';
import { css, html, nothing, render, type ReactiveController } from 'lit';
import { adoptStyles } from '../../viewer/styles.js';
import type { CameraPose } from '../../viewer/camera/orbit.js';
import { poseOf } from '../../viewer/camera/settings.js';
import type { Viewer } from '../../viewer/viewer.js';
import { prefersReducedMotion } from '../../viewer/motion.js';
import type { Feature } from '../../viewer/features.js';
import { languageOf } from '../../viewer/strings.js';
import { fail, poseOfView, type CameraView, type ViewContext } from '../../viewer/camera/camera-view.js';
import { Flight } from './flight.js';
import { pathOfList, turntable, type CameraPath, type PathName } from '../../viewer/camera/camera-path.js';
import { easingOf, pathThrough, unwound, type Easing } from '../../viewer/camera/path.js';
import { readViews, type NamedView, type ViewList } from '../../viewer/camera/read-views.js';

/** Options of a flight. */
export interface FlightOptions {
  /** Duration of the flight, milliseconds; 0 jumps. Default 1200. */
  readonly duration?: number;
  /** Acceleration and deceleration of the flight. Default `ease-in-out`. */
  readonly easing?: Easing;
}

/** Options of a flight along a path. */
export interface PathOptions {
  /** Duration of the entire path, milliseconds. Default: that of its keyframes, or 3000 per view. */
  readonly duration?: number;
  /** Acceleration and deceleration over the path. Default `linear`. */
  readonly easing?: Easing;
  /** Whether the flight restarts at the end, until a visitor takes over the camera. Default false. */
  readonly loop?: boolean;
  /** Path of the flight. Default `views`: through the list. `turntable`: once around the target, in 8 s. */
  readonly path?: PathName;
}

const DURATION_MS = 1_200;

const WORDS = {
  views: 'Views',
  'next-view': 'Next view',
  'previous-view': 'Previous view',
  'keys-views': 'N and P show the next and the previous view, 1 to 9 the first ones.',
};

const STYLES = css`
  [part='views'] {
    display: var(--views-display, flex);
    position: absolute;
    inset: 8px 8px auto;
    justify-content: center;
    align-items: center;
    flex-wrap: wrap;
    gap: 4px;
    pointer-events: none;
    font: var(--message-font, 0.875rem/1.4 system-ui, sans-serif);
  }
  [part='views'] > button,
  [part='view-name'] {
    pointer-events: auto;
    padding: 8px;
    border: 0;
    border-radius: 18px;
    line-height: 20px;
    background: var(--interaction-prompt-background, rgb(0 0 0 / 0.6));
    color: var(--interaction-prompt-color, rgb(255 255 255));
  }
  [part='views'] > button {
    line-height: 0;
    cursor: pointer;
  }
  [part='views'] > button:dir(rtl) svg {
    transform: scaleX(-1);
  }
  [part='views'] ::slotted(*) {
    pointer-events: auto;
  }
`;

/** Views of an element: the list, flights between views, and the bar, keys and texts to select a view. */
export class Tour implements ReactiveController, Feature {
  readonly #viewer: Viewer;
  #flight: Flight | undefined;
  #source: unknown;
  #list: Promise<ViewList> = Promise.resolve(NO_VIEWS);
  #views: readonly NamedView[] = [];
  #children: readonly HTMLElement[] = [];
  #current = -1;
  #bar: HTMLElement | undefined;
  #keys: AbortController | undefined;

  constructor(viewer: Viewer) {
    this.#viewer = viewer;
    const { element } = viewer;
    element.addController(this);
    element.addEventListener('click', this.#onClick);
    this.hostUpdated();
  }

  hostUpdated(): void {
    this.#readChildren();
    const { views } = this.#viewer.attributes;
    if (views !== this.#source) {
      this.#source = views;
      this.#list = this.#load(views);
    }
    this.#show();
  }

  hostDisconnected(): void {
    this.#flight?.cancel();
  }

  advance(now: number): boolean {
    const flight = this.#flight;
    if (flight === undefined || flight.isOver) return false;
    // Delays automatic rotation until the camera has arrived.
    this.#viewer.rest();
    flight.advance(now);
    return !flight.isOver;
  }

  async flyTo(view: CameraView | string | number, options: FlightOptions = {}): Promise<boolean> {
    const { views } = await this.#ready();
    if (typeof view === 'object') return this.#fly(view, options, -1);
    const index = typeof view === 'number' ? view : views.findIndex(({ name }) => name === view);
    if (!views[index]) throw fail('flyTo', `one of ${JSON.stringify(views.map(({ name }) => name))}`, view);
    return this.#fly(views[index].view, options, index);
  }

  async step(by: number, options: FlightOptions = {}): Promise<boolean> {
    const { views } = await this.#ready();
    if (views.length === 0) return false;
    // Without a current view, the next view is the first, and the previous view is the last.
    const from = this.#current < 0 && by < 0 ? 0 : this.#current;
    const index = (from + by + views.length) % views.length;
    // At once, so that a later call finds this view as the current one.
    return this.#fly(views[index].view, options, index);
  }

  async flyPath({ duration, easing = 'linear', loop = false, path: name }: PathOptions = {}): Promise<boolean> {
    const path = await this.path(name);
    if (path === null) return false;
    const length = duration ?? path.seconds * 1_000;
    const ease = easingOf(easing);
    const place = (elapsed: number): CameraPose => path.at(ease(loop ? (elapsed % length) / length : elapsed / length));
    this.#current = -1;
    if (prefersReducedMotion() || !(length > 0)) return this.#start(() => path.at(1), 0);
    return this.#start(place, loop ? Infinity : length);
  }

  async seekPath(share: number): Promise<void> {
    const path = await this.path();
    if (path === null) return;
    this.#flight?.cancel();
    this.#viewer.camera.moveTo(path.at(Math.min(1, Math.max(0, share || 0))));
  }

  /**
   * Waits for the list and the scene, which percentages and `auto` depend on, then returns the list with the views of
   * the children.
   */
  async #ready(): Promise<ViewList> {
    await this.#viewer.element.updateComplete;
    await this.#viewer.settled;
    this.#readChildren();
    const { path } = await this.#list;
    return { views: this.#views, path };
  }

  /** The last computed path, because a page that scrolls requests it in every frame. */
  #known: { readonly list: ViewList; readonly place: string; readonly path: CameraPath | null } | undefined;

  /**
   * Returns a path of the camera by name; null if the list has no views.
   * @param aspect Width / height of the frames. Default: that of the element.
   */
  async path(name: PathName = 'views', aspect = this.#viewer.camera.context.aspect): Promise<CameraPath | null> {
    const list = await this.#ready();
    const { context } = this.#viewer.camera;
    if (name === 'turntable') return turntable(poseFor(aspect, context));
    const place = JSON.stringify({ ...context, from: undefined, aspect });
    if (!this.#known || this.#known.place !== place || !isSameList(this.#known.list, list))
      this.#known = { list, place, path: pathOfList(list, { ...context, aspect }) };
    return this.#known.path;
  }

  #fly(
    view: CameraView,
    { duration = DURATION_MS, easing = 'ease-in-out' }: FlightOptions,
    index: number,
  ): Promise<boolean> {
    const { camera } = this.#viewer;
    // A flight begins where the camera is, which may still be on the way to its goal.
    const { theta, phi, radius } = camera.orbit;
    const { x, y, z } = camera.target;
    const from: CameraPose = { theta, phi, radius, x, y, z, fieldOfView: camera.fieldOfView.radians };
    const to = unwound(poseOfView(view, camera.context), from);
    const ease = easingOf(easing);
    const along = pathThrough([from, to], [0, 1]);
    const path = (elapsed: number): CameraPose => (elapsed >= duration ? to : along(ease(elapsed / duration)));
    this.#choose(index);
    const isSeen = this.#viewer.isOnShow && !prefersReducedMotion();
    return this.#start(path, isSeen ? Math.max(0, duration) : 0, index);
  }

  async #start(path: (elapsed: number) => CameraPose, duration: number, index = -1): Promise<boolean> {
    this.#flight?.cancel();
    const { camera } = this.#viewer;
    const flight = (this.#flight = new Flight(camera, duration === 0 ? () => path(Infinity) : path, duration));
    this.#viewer.rest();
    const announcer = this.#viewer.announcer.value!;
    announcer.isQuiet = true;
    this.#viewer.requestFrame();
    const arrived = await flight.finished;
    if (this.#flight === flight) announcer.isQuiet = false;
    const view = this.#views[index];
    if (arrived && view) announcer.say(`${view.name} (${index + 1}/${this.#views.length})`);
    return arrived;
  }

  #choose(index: number): void {
    this.#current = index;
    this.#show();
    if (index < 0) return;
    const { name } = this.#views[index];
    this.#viewer.element.dispatchEvent(new CustomEvent('view-change', { detail: { name, index } }));
  }

  async #load(source: object | string | null): Promise<ViewList> {
    const isCurrent = (): boolean => this.#source === source;
    try {
      const json = typeof source === 'string' ? await readJson(source, this.#viewer.element.baseURI) : source;
      const list = json ? readViews(json) : NO_VIEWS;
      if (isCurrent()) this.#setViews(list.views);
      return list;
    } catch (error) {
      if (isCurrent()) {
        this.#setViews([]);
        this.#viewer.warn(`<gaussian-splat> views: ${error instanceof Error ? error.message : String(error)}`);
      }
      return NO_VIEWS;
    }
  }

  #listed: readonly NamedView[] = [];

  #setViews(views: readonly NamedView[]): void {
    this.#listed = views;
    this.#join();
  }

  /**
   * Reads the children with `data-orbit`: hotspots, and buttons in the slot `view`. Without a target, a hotspot looks
   * at its own point.
   */
  #readChildren(): void {
    this.#children = [...this.#viewer.element.querySelectorAll<HTMLElement>(':scope > [data-orbit]')];
    this.#join();
  }

  #join(): void {
    const own = this.#children.map((child) => {
      const { orbit, target, position, fieldOfView, view } = child.dataset;
      const looksAt = target ?? position;
      return {
        name: view ?? child.getAttribute('aria-label') ?? child.textContent.trim(),
        view: { orbit, ...(looksAt && { target: looksAt }), ...(fieldOfView && { fieldOfView }) },
      };
    });
    this.#views = [...own, ...this.#listed];
    this.#show();
  }

  readonly #onClick = (event: Event): void => {
    const index = this.#children.findIndex((child) => child.contains(event.target as Node));
    if (index >= 0) this.#go(index);
  };

  #go(index: number): void {
    this.flyTo(index).catch(this.#warnOf);
  }

  #step(by: number): void {
    this.step(by).catch(this.#warnOf);
  }

  readonly #warnOf = ({ message }: Error): void => this.#viewer.warn(`<gaussian-splat> views: ${message}`);

  #show(): void {
    const root = this.#viewer.element.shadowRoot;
    const { surface } = this.#viewer;
    if (root === null || surface === null) return;
    this.#children.forEach((child, i) => {
      if (i === this.#current) child.setAttribute('aria-current', 'true');
      else child.removeAttribute('aria-current');
    });
    this.#bar ??= addBar(root);
    this.#listen(surface);
    const { isOnShow } = this.#viewer;
    render(isOnShow && this.#views.length > 0 ? this.#template() : nothing, this.#bar);
    if (this.#bar.querySelector('#view-keys') && surface.getAttribute('aria-describedby') === 'keys')
      surface.setAttribute('aria-describedby', 'keys view-keys');
  }

  #template(): unknown {
    const { strings } = this.#viewer;
    const word = (key: keyof typeof WORDS): string => strings[key] ?? WORDS[key];
    const lang = languageOf(strings) ?? nothing;
    const hasSlot = this.#children.some(({ slot }) => slot === 'view');
    const name = this.#views[this.#current]?.name ?? `${this.#views.length}`;
    const button = (key: 'next-view' | 'previous-view', by: number, sign: string): unknown =>
      html`<button type="button" part=${key} aria-label=${word(key)} lang=${lang} @click=${() => this.#step(by)}>
        <svg viewBox="0 0 24 24" width="20" height="20" aria-hidden="true" fill="currentColor"><path d=${sign} /></svg>
      </button>`;
    return html`<div part="views" role="group" aria-label=${word('views')} lang=${lang}>
        ${button('previous-view', -1, 'M15 5v14l-9-7z')}
        ${hasSlot ? html`<slot name="view"></slot>` : html`<span part="view-name" lang="">${name}</span>`}
        ${button('next-view', 1, 'M9 5v14l9-7z')}
      </div>
      <span id="view-keys" hidden lang=${lang}>${word('keys-views')}</span>`;
  }

  #listen(surface: HTMLElement): void {
    if (this.#keys !== undefined) return;
    this.#keys = new AbortController();
    surface.addEventListener('keydown', this.#onKey, { signal: this.#keys.signal });
  }

  readonly #onKey = (event: KeyboardEvent): void => {
    if (event.ctrlKey || event.altKey || event.metaKey || this.#views.length === 0) return;
    const key = event.key.toLowerCase();
    const index = Number(key) - 1;
    if (key === 'n' || key === 'p') this.#step(key === 'n' ? 1 : -1);
    else if (index >= 0 && index < this.#views.length) this.#go(index);
    else return;
    event.preventDefault();
  };
}

/** Returns the pose of the camera for frames of a shape. A camera at the distance of the attributes frames that shape. */
function poseFor(aspect: number, { settings, bounds, aspect: own, from }: ViewContext): CameraPose {
  const isFramed = from.radius === poseOf(settings, bounds, own).radius;
  return isFramed ? { ...from, radius: poseOf(settings, bounds, aspect).radius } : from;
}

/** Maximum size of a file of views, bytes: it is parsed on the main thread. */
const MAX_VIEWS = 2 ** 22;

/**
 * Whether two lists have the same views. Compares each view, because every call creates a new list with the views of
 * the children.
 */
const isSameList = (a: ViewList, b: ViewList): boolean =>
  a.path === b.path && a.views.length === b.views.length && a.views.every(({ view }, i) => view === b.views[i].view);

const NO_VIEWS: ViewList = { views: [], path: [] };

async function readJson(source: string, base: string): Promise<unknown> {
  if (/^\s*[[{]/.test(source)) return JSON.parse(source);
  const url = new URL(source, base);
  const response = await fetchPatiently(url);
  if (!response.ok) throw new Error(`expected a JSON file at ${url.href}, found status ${response.status}`);
  return JSON.parse(new TextDecoder().decode(await bytesOf(response, undefined, MAX_VIEWS)));
}

/** Appends the bar to the shadow tree, next to the content that Lit renders, and adds its style sheet. */
function addBar(root: ShadowRoot): HTMLElement {
  const bar = root.ownerDocument.createElement('div');
  root.append(bar);
  adoptStyles(root, STYLES);
  return bar;
}
