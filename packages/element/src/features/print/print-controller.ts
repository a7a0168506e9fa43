import type { ReactiveController } from 'lit';
import type { Viewer } from '../../viewer/viewer.js';

/**
 * Shows a copy of the frame over the canvas while the page is printed, because browsers do not print WebGPU canvases.
 */
export class PrintController implements ReactiveController {
  readonly #viewer: Viewer;
  #copy: HTMLCanvasElement | undefined;

  constructor(viewer: Viewer) {
    this.#viewer = viewer;
    viewer.element.addController(this);
  }

  hostConnected(): void {
    addEventListener('beforeprint', this.#put);
    addEventListener('afterprint', this.#take);
  }

  hostDisconnected(): void {
    removeEventListener('beforeprint', this.#put);
    removeEventListener('afterprint', this.#take);
    this.#take();
  }

  readonly #put = (): void => {
    this.#take();
    const drawn = this.#viewer.drawNow();
    if (drawn === null) return;
    // The copy has the same part name, so that the page's styles of the canvas apply to it.
    const copy = drawn.cloneNode() as HTMLCanvasElement;
    copy.getContext('2d')?.drawImage(drawn, 0, 0);
    // The width of the paper differs from that of the window, so the copy is fitted.
    Object.assign(copy.style, { position: 'absolute', inset: '0', objectFit: 'contain' });
    drawn.after(copy);
    this.#copy = copy;
  };

  readonly #take = (): void => {
    this.#copy?.remove();
    this.#copy = undefined;
  };
}
