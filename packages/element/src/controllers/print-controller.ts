import type { ReactiveController, ReactiveControllerHost } from 'lit';

/** Puts a copy of the picture over the canvas while the page is printed: on paper browsers leave WebGPU canvases out. */
export class PrintController implements ReactiveController {
  readonly #draw: () => HTMLCanvasElement | null;
  #copy: HTMLCanvasElement | undefined;

  /** @param draw draws a frame now and returns its canvas, null where there is nothing to draw. */
  constructor(host: ReactiveControllerHost, draw: () => HTMLCanvasElement | null) {
    this.#draw = draw;
    host.addController(this);
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
    const drawn = this.#draw();
    if (drawn === null) return;
    // With the part's name, so that what a page says of the canvas holds for its copy.
    const copy = drawn.cloneNode() as HTMLCanvasElement;
    copy.getContext('2d')?.drawImage(drawn, 0, 0);
    // Paper has another width than the window.
    Object.assign(copy.style, { position: 'absolute', inset: '0', objectFit: 'contain' });
    drawn.after(copy);
    this.#copy = copy;
  };

  readonly #take = (): void => {
    this.#copy?.remove();
    this.#copy = undefined;
  };
}
