import type { Camera } from '@gaussian-splat/core';
import { parsePoint } from '../camera/grammar.js';
import type { ViewerFrame } from '../camera/orbit.js';
import { LabelBox, LabelView, type Located } from '../controllers/label-box.js';

/** Labels move by whole device pixels and more. */
const MIN_MOVE = 0.5;

interface ArLabel {
  readonly box: LabelBox;
  readonly place: Located;
}

/** The element's labels over the camera's image of a phone: their slots come before those of the element while the session lasts. */
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

  /** Moves labels to where a camera has their points. @param camera in the scene's own frame */
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
