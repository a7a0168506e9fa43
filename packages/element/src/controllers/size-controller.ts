import type { ReactiveController, ReactiveControllerHost } from 'lit';

/** The window that a node is in: that of its document, which may be an `<iframe>`'s or a popup's. Where that has none any more, the page's own. */
export const windowOf = ({ ownerDocument }: Node): Window & typeof globalThis =>
  (ownerDocument?.defaultView as (Window & typeof globalThis) | null | undefined) ?? window;

/** Dense displays have 4, and zooming multiplies it by 5 at most. */
const MAX_RATIO = 20;

/** A size in whole device pixels. */
export interface PixelSize {
  readonly width: number;
  readonly height: number;
}

/** Knows how many device pixels the picture covers, through resizes, zoom and moves between screens. */
export class SizeController implements ReactiveController {
  readonly #canvasOf: () => HTMLCanvasElement | null;
  readonly #onChange: () => void;
  #canvas: HTMLCanvasElement | null = null;
  #observer: ResizeObserver | undefined;
  #resolution: MediaQueryList | undefined;
  #deviceSize: PixelSize | undefined;

  /** @param canvasOf the canvas, once it is rendered. */
  constructor(host: ReactiveControllerHost, canvasOf: () => HTMLCanvasElement | null, onChange: () => void) {
    this.#canvasOf = canvasOf;
    this.#onChange = onChange;
    host.addController(this);
  }

  /**
   * Size to draw at; null while there is no pixel to draw, or the size is not known yet.
   * @param maxPixelRatio most drawn pixels for one CSS pixel.
   * @param maxSide longest side that the device's textures may have, in pixels.
   */
  pixelSize(maxPixelRatio: number, maxSide: number): PixelSize | null {
    const { width, height } = this.#deviceSize ?? { width: 0, height: 0 };
    if (width === 0 || height === 0) return null;
    const shrink = Math.min(1, maxPixelRatio / this.#pixelRatio, maxSide / Math.max(width, height));
    return { width: Math.max(1, Math.round(width * shrink)), height: Math.max(1, Math.round(height * shrink)) };
  }

  /** Width / height; 1 while there is none. */
  get aspect(): number {
    const { width, height } = this.#deviceSize ?? { width: 0, height: 0 };
    return width > 0 && height > 0 ? width / height : 1;
  }

  /** True where there is surely no pixel to draw, as with `display: none`. */
  get isEmpty(): boolean {
    if (this.#canvas === null) return false;
    const { width, height } = this.#deviceSize ?? {
      width: this.#canvas.clientWidth,
      height: this.#canvas.clientHeight,
    };
    return width === 0 || height === 0;
  }

  /** Device pixels for one CSS pixel; scripts of the page may have replaced it by anything. */
  get #pixelRatio(): number {
    const ratio = this.#canvas ? windowOf(this.#canvas).devicePixelRatio : devicePixelRatio;
    return ratio > 0 ? Math.min(ratio, MAX_RATIO) : 1;
  }

  hostConnected(): void {
    this.#observe();
  }

  hostUpdated(): void {
    this.#observe();
  }

  hostDisconnected(): void {
    this.#observer?.disconnect();
    this.#observer = undefined;
    this.#resolution?.removeEventListener('change', this.#onResolution);
    this.#resolution = undefined;
  }

  #observe(): void {
    const canvas = this.#canvasOf();
    // Another one may have taken its place.
    if (canvas !== this.#canvas) this.hostDisconnected();
    this.#canvas = canvas;
    if (this.#canvas === null || this.#observer !== undefined) return;
    const { ResizeObserver } = windowOf(this.#canvas);
    if (!ResizeObserver) return this.#setFromCss(this.#canvas.clientWidth, this.#canvas.clientHeight);
    this.#observer = new ResizeObserver((entries) => this.#update(entries[entries.length - 1]));
    try {
      // Exact device pixels, also where the element's edges lie between them.
      this.#observer.observe(this.#canvas, { box: 'device-pixel-content-box' });
    } catch {
      // Safari knows no device-pixel box: it gets CSS pixels, and a look-out for changes of the ratio.
      this.#observer.observe(this.#canvas);
      this.#watchResolution();
    }
  }

  #update(entry: ResizeObserverEntry): void {
    const exact = entry.devicePixelContentBoxSize?.[0];
    const { width, height } = entry.contentRect;
    // Under an emulated pixel ratio (DevTools, Playwright) Chromium counts CSS pixels as device pixels.
    const isEmulated =
      this.#pixelRatio !== 1 && exact?.inlineSize === Math.round(width) && exact.blockSize === Math.round(height);
    if (exact && !isEmulated) return this.#set({ width: exact.inlineSize, height: exact.blockSize });
    this.#setFromCss(width, height);
  }

  #setFromCss(width: number, height: number): void {
    this.#set({ width: Math.round(width * this.#pixelRatio), height: Math.round(height * this.#pixelRatio) });
  }

  #set(size: PixelSize): void {
    if (size.width === this.#deviceSize?.width && size.height === this.#deviceSize.height) return;
    this.#deviceSize = size;
    this.#onChange();
  }

  #watchResolution(): void {
    const view = this.#canvas ? windowOf(this.#canvas) : window;
    this.#resolution = view.matchMedia(`(resolution: ${this.#pixelRatio}dppx)`);
    this.#resolution.addEventListener('change', this.#onResolution, { once: true });
  }

  readonly #onResolution = (): void => {
    this.#watchResolution();
    if (this.#canvas !== null) this.#setFromCss(this.#canvas.clientWidth, this.#canvas.clientHeight);
  };
}
