import type { Camera } from '@gaussian-splat/core';
import type { ProbeAnswer, ProbePoint } from '@gaussian-splat/renderer/tools';
import { css, type ReactiveController, type ReactiveControllerHost } from 'lit';
import { parsePoint } from '../camera/grammar.js';
import { toScene } from '../camera/orbit.js';
import { project } from '../camera/projection.js';
import { ScenePoint } from '../camera/values.js';
import { adoptStyles } from '../styles.js';
import type { CameraController } from './camera-controller.js';
import { labelParts } from './label-parts.js';

const STYLES = css`
  .hotspot {
    position: absolute;
    top: 0;
    left: 0;
    opacity: var(--max-hotspot-opacity, 1);
    transition: opacity 0.3s;
  }
  .hotspot:not(.placed) {
    visibility: hidden;
  }
  .hotspot ::slotted(*) {
    pointer-events: auto;
  }
  .hotspot.hidden {
    opacity: var(--min-hotspot-opacity, 0.25);
  }
  .hotspot.hidden:not(.with-panel) ::slotted(*) {
    pointer-events: none;
  }
  .hotspot.hidden:focus-within {
    opacity: var(--max-hotspot-opacity, 1);
  }
  @media (prefers-reduced-motion: reduce) {
    .hotspot {
      transition: none;
    }
  }
`;

export interface HotspotHost {
  readonly camera: Pick<CameraController, 'viewerFrame' | 'bounds'>;
  /** Holds a box for each of {@link HotspotController.names}, in their order, once it is rendered. */
  readonly hotspotLayer: HTMLElement | null;
  /** Looks into the last frame. Rejects if it is gone. */
  probe(points: readonly ProbePoint[]): Promise<readonly ProbeAnswer[]>;
  warn(sentence: string): void;
}

/** A label of the page at a point of the scene, as `queryHotspot` gives it. */
export interface HotspotPlace {
  /** Viewer space. */
  readonly position: ScenePoint;
  /** Direction away from the surface that it belongs to; null where the page gives none. */
  readonly normal: ScenePoint | null;
  /** CSS pixels from the element's left and top edge; null while it is behind the camera or nothing is drawn. */
  readonly canvasPosition: { readonly x: number; readonly y: number } | null;
  /** False where its normal points away from the camera. */
  readonly facingCamera: boolean;
  /** False where it faces away, is hidden by scenery, or is behind the camera or outside of the frame. */
  readonly visible: boolean;
}

type Point = readonly [x: number, y: number, z: number];

interface Hotspot {
  readonly elements: readonly HTMLElement[];
  readonly position: Point | null;
  readonly normal: Point | null;
  x: number;
  y: number;
  depth: number;
  facesCamera: boolean;
  isOccluded: boolean;
  isVisible: boolean;
}

const PREFIX = 'hotspot-';
/** Less light than this from a hotspot, and scenery hides it. */
const HIDDEN_BELOW = 0.5;
/** A label on a surface is in front of it by this share of the scene's size: splats are thick. */
const IN_FRONT = 0.03;
/** Least time between two looks at what hides them while the camera moves, ms. */
const PROBE_INTERVAL_MS = 100;

/** Keeps children with `slot="hotspot-…"` at their points of the scene, and fades those that cannot be seen. */
export class HotspotController implements ReactiveController {
  readonly #host: ReactiveControllerHost & HTMLElement;
  readonly #of: HotspotHost;
  #hotspots = new Map<string, Hotspot>();
  #observer: MutationObserver | undefined;
  #camera: Camera | undefined;
  /** What each label was told last. */
  readonly #told = new WeakMap<HTMLElement, boolean>();
  #isProbing = false;
  #isStale = false;

  constructor(host: ReactiveControllerHost & HTMLElement, of: HotspotHost) {
    this.#host = host;
    this.#of = of;
    adoptStyles(host.shadowRoot!, STYLES);
    host.addController(this);
  }

  /** Names of the slots that children ask for, each once. */
  get names(): readonly string[] {
    return [...this.#hotspots.keys()];
  }

  hostConnected(): void {
    this.#observer = new MutationObserver(() => this.#collect());
    const attributeFilter = ['slot', 'data-position', 'data-normal', 'data-orbit'];
    this.#observer.observe(this.#host, { childList: true, subtree: true, attributeFilter });
    // Such events do not bubble.
    this.#host.addEventListener('toggle', this.#onToggle, true);
    this.#collect();
  }

  hostUpdated(): void {
    this.#place();
  }

  hostDisconnected(): void {
    this.#observer?.disconnect();
    this.#host.removeEventListener('toggle', this.#onToggle, true);
  }

  /** A panel was opened or closed. */
  readonly #onToggle = (): void => this.#place();

  /** A frame was drawn from this camera. */
  frameDrawn(camera: Camera): void {
    this.#camera = camera;
    if (this.#hotspots.size === 0) return;
    this.#place();
    void this.#look();
  }

  /** Nothing is on show any more: labels are gone until the next frame. */
  forget(): void {
    this.#camera = undefined;
    this.#place();
  }

  /** Where a hotspot is; null for a name that no child has, or one without a position. */
  query(name: string): HotspotPlace | null {
    const hotspot = this.#hotspots.get(name);
    if (!hotspot?.position) return null;
    const { position, normal, x, y, depth, facesCamera } = hotspot;
    return {
      position: new ScenePoint(...position),
      normal: normal && new ScenePoint(...normal),
      canvasPosition: depth > 0 ? { x, y } : null,
      facingCamera: facesCamera,
      visible: hotspot.isVisible,
    };
  }

  #collect(): void {
    const before = this.#hotspots;
    const children = [...this.#host.children].filter(
      (child): child is HTMLElement => 'dataset' in child && child.slot.startsWith(PREFIX),
    );
    this.#hotspots = new Map(
      [...groupBySlot(children)].map(([name, elements]) => [name, this.#read(elements, before.get(name))]),
    );
    this.#host.requestUpdate();
    if (before.size + this.#hotspots.size === 0) return;
    // Where they are now is known once their boxes are.
    void this.#host.updateComplete.then(() => this.#look());
  }

  #read(elements: readonly HTMLElement[], before: Hotspot | undefined): Hotspot {
    const [{ dataset, slot }] = elements;
    const read = (name: string, text: string | undefined): Point | null => {
      const point = text === undefined ? null : parsePoint(text);
      if (text !== undefined && point === null)
        this.#of.warn(`<gaussian-splat> ${slot}: ${name} expects "x y z" in metres, found "${text.slice(0, 200)}".`);
      return point;
    };
    const position = read('data-position', dataset.position);
    const normal = read('data-normal', dataset.normal);
    const fresh = { x: 0, y: 0, depth: 0, facesCamera: true, isOccluded: false, isVisible: false };
    return { ...fresh, ...before, elements, position, normal };
  }

  /** Moves the boxes to where the last frame has their points, and hides those that are in no frame. */
  #place(): void {
    const boxes = this.#of.hotspotLayer?.children;
    // Read once, before anything is written: each reading after a change of style would be another layout.
    const { clientWidth: width, clientHeight: height } = this.#host;
    [...this.#hotspots.values()].forEach((hotspot, i) => {
      const box = boxes?.[i] as HTMLElement | undefined;
      if (box === undefined) return;
      this.#locate(hotspot, width, height);
      const isPlaced = hotspot.depth > 0;
      box.classList.toggle('placed', isPlaced);
      if (isPlaced) box.style.transform = `translate(${hotspot.x}px, ${hotspot.y}px) translate(-50%, -50%)`;
      this.#show(hotspot, box, width, height);
    });
  }

  #locate(hotspot: Hotspot, width: number, height: number): void {
    const camera = this.#camera;
    hotspot.depth = 0;
    if (camera === undefined || hotspot.position === null) return;
    const { x, y, depth } = project(camera, toScene(this.#of.camera.viewerFrame, hotspot.position));
    hotspot.x = (x * width) / camera.width;
    hotspot.y = (y * height) / camera.height;
    hotspot.depth = depth > camera.near ? depth : 0;
    hotspot.facesCamera = this.#facesCamera(hotspot, camera);
  }

  #facesCamera({ position, normal }: Hotspot, { worldToCamera: m }: Camera): boolean {
    if (normal === null || position === null) return true;
    const frame = this.#of.camera.viewerFrame;
    const [n, p] = [toScene(frame, normal), toScene(frame, position)];
    // In the camera's axes the eye is at 0, so the way from the eye to the point is the point itself.
    const row = (r: number, v: Point, w: number): number =>
      m[4 * r] * v[0] + m[4 * r + 1] * v[1] + m[4 * r + 2] * v[2] + w * m[4 * r + 3];
    return [0, 1, 2].reduce((sum, r) => sum + row(r, n, 0) * row(r, p, 1), 0) < 0;
  }

  #show(hotspot: Hotspot, box: HTMLElement, width: number, height: number): void {
    const { x, y } = hotspot;
    const isOpen = hotspot.depth > 0 && hotspot.facesCamera && !hotspot.isOccluded;
    // Of a label whose point has left the frame a part may still be there to read.
    box.classList.toggle('hidden', !isOpen);
    const holdsPanel = !isOpen && hotspot.elements.some((element) => element.querySelector(labelParts.panel) !== null);
    box.classList.toggle('with-panel', holdsPanel);
    const isVisible = isOpen && x >= 0 && y >= 0 && x <= width && y <= height;
    hotspot.isVisible = isVisible;
    for (const element of hotspot.elements) {
      if (this.#told.get(element) === isVisible) continue;
      this.#told.set(element, isVisible);
      const { visibilityAttribute } = element.dataset;
      if (visibilityAttribute) element.toggleAttribute(`data-${visibilityAttribute}`, isVisible);
      element.dispatchEvent(new CustomEvent('hotspot-visibility', { detail: { visible: isVisible } }));
    }
  }

  /** Asks the GPU, beside the frames and not within them, what hides the hotspots; again if the camera moved meanwhile. */
  async #look(): Promise<void> {
    this.#isStale = true;
    if (this.#isProbing) return;
    this.#isProbing = true;
    try {
      while (this.#isStale && this.#host.isConnected) {
        this.#isStale = false;
        await this.#lookOnce();
        await new Promise((resolve) => setTimeout(resolve, PROBE_INTERVAL_MS));
      }
    } catch {
      // The frame is gone, with its scene or its device; the next one asks again.
    } finally {
      this.#isProbing = false;
    }
  }

  async #lookOnce(): Promise<void> {
    const { clientWidth, clientHeight } = this.#host;
    const camera = this.#camera;
    const asked = [...this.#hotspots.values()].filter(({ depth }) => depth > 0);
    if (camera === undefined || asked.length === 0) return;
    const margin = IN_FRONT * this.#of.camera.bounds.radius;
    const points = asked.map(({ x, y, depth }) => ({
      x: (x * camera.width) / clientWidth,
      y: (y * camera.height) / clientHeight,
      depth: depth - margin,
    }));
    const answers = await this.#of.probe(points);
    answers.forEach(({ transmittance }, i) => (asked[i].isOccluded = transmittance < HIDDEN_BELOW));
    this.#place();
  }
}

function groupBySlot(children: readonly HTMLElement[]): Map<string, HTMLElement[]> {
  const groups = new Map<string, HTMLElement[]>();
  for (const child of children) {
    const group = groups.get(child.slot);
    if (group) group.push(child);
    else groups.set(child.slot, [child]);
  }
  return groups;
}
