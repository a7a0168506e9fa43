import type { Camera } from '@gaussian-splat/core';
import { css, type ReactiveController } from 'lit';
import { parsePoint } from '../../viewer/camera/grammar.js';
import { ScenePoint } from '../../viewer/camera/values.js';
import { adoptStyles } from '../../viewer/styles.js';
import type { Feature } from '../../viewer/features.js';
import type { Viewer } from '../../viewer/viewer.js';
import { LabelBox, LabelView, type Located } from '../../shared/label-box.js';
import { labelParts } from '../../shared/label-parts.js';
import { windowOf } from '../../viewer/size-controller.js';

const STYLES = css`
  .hotspot {
    position: absolute;
    top: 0;
    left: 0;
  }
  /* Apart from the box that moves: style of what has transitions takes three times as long to recalculate. */
  /* The label in use lies over the others. A z-index of the page cannot reach out of its own box. */
  .hotspot:is(:hover, :focus-within, .with-panel) {
    z-index: 1;
  }
  .hotspot > div {
    /* Isolated, so that a fading label does not cause a layout. */
    isolation: isolate;
    opacity: var(--max-hotspot-opacity, 1);
    transition: opacity 0.3s;
  }
  .hotspot:not(.placed) {
    visibility: hidden;
  }
  .hotspot ::slotted(*) {
    pointer-events: auto;
  }
  /* A page's own display of its buttons does not show a label that is hidden. */
  .hotspot ::slotted([hidden]:not([hidden='until-found'])) {
    display: none !important;
  }
  .hotspot.hidden > div {
    opacity: var(--min-hotspot-opacity, 0.25);
  }
  .hotspot.hidden:not(.with-panel) ::slotted(*) {
    pointer-events: none;
  }
  .hotspot.hidden > :focus-within {
    opacity: var(--max-hotspot-opacity, 1);
  }
  @media (prefers-reduced-motion: reduce) {
    .hotspot > div {
      transition: none;
    }
  }
`;

/** A hotspot at a point of the scene, as returned by `queryHotspot`. */
export interface HotspotPlace {
  /** Position in viewer space, the coordinates of orbit and target. */
  readonly position: ScenePoint;
  /** Normal of the surface at the hotspot, in viewer space; null if the page specifies none. */
  readonly normal: ScenePoint | null;
  /**
   * Position in the element, in CSS pixels from its left and top edge. Null while the hotspot is behind the camera, or
   * if nothing is drawn.
   */
  readonly canvasPosition: { readonly x: number; readonly y: number } | null;
  /** Whether the normal points toward the camera; true without a normal. */
  readonly facingCamera: boolean;
  /** Whether the hotspot is within the frame, in front of the camera, faces it, and is not occluded. */
  readonly visible: boolean;
}

interface Hotspot extends Located {
  readonly elements: readonly HTMLElement[];
  isOccluded: boolean;
  isVisible: boolean;
  /** Whether it is a door. Doors are shown when the code for doors is loaded, which hides those of other rooms. */
  readonly isDoor: boolean;
  /** Whether one of the hotspot's elements contains an open panel. */
  hasPanel: boolean;
}

const PREFIX = 'hotspot-';
/** Events that may open or close a panel of a label. */
const PANEL_EVENTS = ['toggle', 'fullscreenchange'];
/** Transmittance, 0..1, of the splats in front of a hotspot below which it counts as occluded. */
const HIDDEN_BELOW = 0.5;
/**
 * Offset of a probed point toward the camera, as a fraction of the scene's radius, because splats are thick: a point on
 * their surface would lie behind some of them.
 */
const IN_FRONT = 0.03;
/**
 * Minimum distance by which a label moves, in device pixels. Shorter moves are invisible, and each write causes a style
 * recalculation.
 */
const VISIBLE_MOVE = 0.5;
/** Minimum interval between two occlusion tests while the camera moves, ms. */
const PROBE_INTERVAL_MS = 100;

/**
 * Keeps children with `slot="hotspot-…"` at their points of the scene, and fades the occluded ones and those that face
 * away.
 */
export class HotspotController implements ReactiveController, Feature {
  readonly #viewer: Viewer;
  #hotspots = new Map<string, Hotspot>();
  #observer: MutationObserver | undefined;
  #camera: Camera | undefined;
  /** Boxes of the labels, by the box's element in the layer. */
  readonly #boxes = new WeakMap<Element, LabelBox>();
  /** Visibility that was last reported to each label by an event. */
  readonly #reported = new WeakMap<HTMLElement, boolean>();
  #isProbing = false;
  #isStale = false;

  constructor(viewer: Viewer) {
    this.#viewer = viewer;
    adoptStyles(viewer.element.shadowRoot!, STYLES);
    viewer.element.addController(this);
  }

  slots(): readonly string[] {
    return [...this.#hotspots.keys()];
  }

  hostConnected(): void {
    this.#observer = new MutationObserver((records) => this.#onMutations(records));
    const attributeFilter = ['slot', 'data-position', 'data-normal', 'data-orbit', 'open'];
    this.#observer.observe(this.#viewer.element, { childList: true, subtree: true, attributeFilter });
    // The event `toggle` does not bubble, so the listeners are capturing ones.
    for (const type of PANEL_EVENTS) this.#viewer.element.addEventListener(type, this.#findPanels, true);
    this.#collect();
  }

  hostDisconnected(): void {
    this.#observer?.disconnect();
    for (const type of PANEL_EVENTS) this.#viewer.element.removeEventListener(type, this.#findPanels, true);
  }

  #onMutations(records: readonly MutationRecord[]): void {
    if (records.some(({ attributeName }) => attributeName !== 'open')) this.#collect();
    else this.#findPanels();
  }

  /**
   * Updates which labels contain an open panel. Called when a panel may have opened or closed, because a query for each
   * label in each frame takes as long as the frame.
   */
  readonly #findPanels = (): void => {
    for (const hotspot of this.#hotspots.values())
      hotspot.hasPanel = hotspot.elements.some((element) => element.querySelector(labelParts.panel) !== null);
    this.hostUpdated();
  };

  /**
   * Moves the labels to their points in a frame, and tests their occlusion. Call after a frame was drawn with this
   * camera.
   */
  frameDrawn(camera: Camera): void {
    this.#camera = camera;
    if (this.#hotspots.size === 0) return;
    this.hostUpdated();
    void this.#look();
  }

  /** Hides all labels until the next frame, because the scene is gone. */
  cleared(): void {
    this.#camera = undefined;
    this.hostUpdated();
  }

  /** Returns the position of a hotspot; null for an unknown name, or for a hotspot without a position. */
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
    const children = [...this.#viewer.element.children].filter(
      (child): child is HTMLElement => 'dataset' in child && child.slot.startsWith(PREFIX),
    );
    this.#hotspots = new Map(
      [...groupBySlot(children)].map(([name, elements]) => [name, this.#read(elements, before.get(name))]),
    );
    this.#viewer.element.requestUpdate();
    if (before.size + this.#hotspots.size === 0) return;
    // The positions are computed with the boxes, which Lit renders first.
    void this.#viewer.element.updateComplete.then(() => this.#look());
  }

  #read(elements: readonly HTMLElement[], before: Hotspot | undefined): Hotspot {
    const [{ dataset, slot }] = elements;
    const read = (name: string, text: string | undefined): Located['position'] => {
      const point = text === undefined ? null : parsePoint(text);
      if (text !== undefined && point === null)
        this.#viewer.warn(
          `<gaussian-splat> ${slot}: ${name} expects "x y z" in meters, found "${text.slice(0, 200)}".`,
        );
      return point;
    };
    const position = read('data-position', dataset.position);
    const normal = read('data-normal', dataset.normal);
    const fresh = { x: 0, y: 0, depth: 0, facesCamera: true, isOccluded: false, isVisible: false };
    const hasPanel = elements.some((element) => element.querySelector(labelParts.panel) !== null);
    const isDoor = elements.some((element) => element.dataset.door !== undefined);
    return { ...fresh, ...before, elements, position, normal, isDoor, hasPanel };
  }

  /**
   * Moves the boxes to the positions of their points in the last frame. Hides the boxes of points behind the camera.
   */
  hostUpdated(): void {
    const boxes = this.#viewer.slotLayer?.children;
    if (boxes === undefined) return;
    // All reads precede all writes, because each read after a write would cause another layout.
    const { clientWidth: width, clientHeight: height } = this.#viewer.element;
    const minMove = VISIBLE_MOVE / windowOf(this.#viewer.element).devicePixelRatio || 0;
    const view = this.#camera && new LabelView(this.#camera, this.#viewer.camera.viewerFrame, width, height);
    const hasDoors = this.#viewer.features.get('doors').value !== undefined;
    let i = 0;
    for (const hotspot of this.#hotspots.values()) {
      const element = boxes[i++] as HTMLElement | undefined;
      if (element === undefined) continue;
      hotspot.depth = 0;
      if (hasDoors || !hotspot.isDoor) view?.locate(hotspot);
      const { x, y, depth, facesCamera, isOccluded, hasPanel } = hotspot;
      const isOpen = depth > 0 && facesCamera && !isOccluded;
      const box = this.#boxOf(element);
      if (depth > 0) box.moveTo(hotspot, minMove);
      else box.remove();
      // A label is shown even if its point has left the frame, because part of the label may still be readable.
      box.show(isOpen, hasPanel);
      this.#notify(hotspot, isOpen && x >= 0 && y >= 0 && x <= width && y <= height);
    }
  }

  #boxOf(element: HTMLElement): LabelBox {
    let box = this.#boxes.get(element);
    if (box === undefined) this.#boxes.set(element, (box = new LabelBox(element)));
    return box;
  }

  #notify(hotspot: Hotspot, isVisible: boolean): void {
    hotspot.isVisible = isVisible;
    for (const element of hotspot.elements) {
      if (this.#reported.get(element) === isVisible) continue;
      this.#reported.set(element, isVisible);
      const { visibilityAttribute } = element.dataset;
      if (visibilityAttribute) element.toggleAttribute(`data-${visibilityAttribute}`, isVisible);
      element.dispatchEvent(new CustomEvent('hotspot-visibility', { detail: { visible: isVisible } }));
    }
  }

  /**
   * Tests the occlusion of hotspots on the GPU, asynchronously to the frames. Tests again if the camera has moved
   * during the test.
   */
  async #look(): Promise<void> {
    this.#isStale = true;
    if (this.#isProbing) return;
    this.#isProbing = true;
    try {
      while (this.#isStale && this.#viewer.element.isConnected) {
        this.#isStale = false;
        await this.#lookOnce();
        await new Promise((resolve) => setTimeout(resolve, PROBE_INTERVAL_MS));
      }
    } catch {
      // The frame is gone, with its scene or its device. The next frame repeats the test.
    } finally {
      this.#isProbing = false;
    }
  }

  async #lookOnce(): Promise<void> {
    const { clientWidth, clientHeight } = this.#viewer.element;
    const camera = this.#camera;
    const asked = [...this.#hotspots.values()].filter(({ depth }) => depth > 0);
    if (camera === undefined || asked.length === 0) return;
    const margin = IN_FRONT * this.#viewer.camera.bounds.radius;
    const points = asked.map(({ x, y, depth }) => ({
      x: (x * camera.width) / clientWidth,
      y: (y * camera.height) / clientHeight,
      depth: depth - margin,
    }));
    const answers = await this.#viewer.probe(points);
    answers.forEach(({ transmittance }, i) => (asked[i].isOccluded = transmittance < HIDDEN_BELOW));
    this.hostUpdated();
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
