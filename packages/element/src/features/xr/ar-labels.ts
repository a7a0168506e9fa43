import type { Camera } from '@gaussian-splat/core';
import { parsePoint } from '../../viewer/camera/grammar.js';
import type { ViewerFrame } from '../../viewer/camera/orbit.js';
import { LabelBox, LabelView, type Located } from '../../shared/label-box.js';

/** Minimum movement of a label, device pixels. Smaller movements are not applied. */
const MIN_MOVE = 0.5;

interface ArLabel {
  readonly box: LabelBox;
  readonly place: Located;
}

/**
 * Shows the labels of the element over the camera image of a phone during an AR session. Slots in a separate layer
 * receive the labels, because they precede the element's own slots of the same names.
 */
export class ArLabels {
  readonly #element: HTMLElement;
  readonly #layer: HTMLElement;
  #labels: readonly ArLabel[] = [];

  constructor(element: HTMLElement, root: HTMLElement) {
    this.#element = element;
    this.#layer = element.ownerDocument.createElement('div');
    root.append(this.#layer);
  }

  show(): void {
    const names = new Map<string, HTMLElement>();
    for (const child of this.#element.children)
      if (child.slot.startsWith('hotspot-') && !names.has(child.slot)) names.set(child.slot, child as HTMLElement);
    this.#labels = [...names].map(([name, { dataset }]) => {
      const read = (text: string | undefined): Located['position'] => (text === undefined ? null : parsePoint(text));
      const place = { position: read(dataset.position), normal: read(dataset.normal) };
      return { box: this.#boxFor(name), place: { ...place, x: 0, y: 0, depth: 0, facesCamera: true } };
    });
  }

  /** Moves the labels to the projections of their points. @param camera Camera in scene coordinates. */
  place(camera: Camera, frame: ViewerFrame): void {
    if (this.#labels.length === 0) return;
    const { clientWidth, clientHeight } = this.#layer.parentElement!;
    const view = new LabelView(camera, frame, clientWidth, clientHeight);
    for (const { box, place } of this.#labels) {
      view.locate(place);
      if (place.depth > 0) box.moveTo(place, MIN_MOVE / devicePixelRatio);
      else box.remove();
      box.show(place.depth > 0 && place.facesCamera, false);
    }
  }

  hide(): void {
    this.#labels = [];
    this.#layer.replaceChildren();
  }

  #boxFor(name: string): LabelBox {
    const { ownerDocument: page } = this.#element;
    const [outer, inner] = [page.createElement('div'), page.createElement('div')];
    inner.append(Object.assign(page.createElement('slot'), { name }));
    outer.append(inner);
    outer.className = 'hotspot hidden';
    this.#layer.append(outer);
    return new LabelBox(outer);
  }
}
