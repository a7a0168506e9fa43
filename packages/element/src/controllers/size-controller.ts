import type { ReactiveController, ReactiveControllerHost } from 'lit';

/**
 * The window of a node: that of its document, which may be an `<iframe>`'s or a popup's. Falls back to the page's own.
 */
export const windowOf = ({ ownerDocument }: Node): Window & typeof globalThis =>
  (ownerDocument?.defaultView as (Window & typeof globalThis) | null | undefined) ?? window;

/** Dense displays have 4, and zooming multiplies it by at most 5. */
const MAX_RATIO = 20;

/** A size in whole device pixels. */
export interface PixelSize {
  readonly width: number;
  readonly height: number;
}

/** Tracks the device pixels of the frame, through resizes, zoom and moves between screens. */
export class SizeController implements ReactiveController {
  readonly #canvasOf: () => HTMLCanvasElement | null;
  readonly #onChange: () => void;
  #canvas: HTMLCanvasElement | null = null;
  #observer: ResizeObserver | undefined;
  #resolution: MediaQueryList | undefined;
  #deviceSize: PixelSize | undefined;

  /** @param canvasOf Returns the canvas, once it is rendered. */
  constructor(host: ReactiveControllerHost, canvasOf: () => HTMLCanvasElement | null, onChange: () => void) {
    this.#canvasOf = canvasOf;
    this.#onChange = onChange;
    host.addController(this);
  }

  /**
   * Size to draw at; null while there is no pixel to draw, or the size is unknown.
   * @param maxPixelRatio Upper limit of device pixels per CSS pixel.
   * @param maxSide Longest side of the device's textures, in pixels.
   */
  pixelSize(maxPixelRatio: number, maxSide: number): PixelSize | null {
    const { width, height } = this.#deviceSize ?? { width: 0, height: 0 };
    if (width === 0 || height === 0) return null;
    const shrink = Math.min(1, maxPixelRatio / this.#pixelRatio, maxSide / Math.max(width, height));
    return { width: Math.max(1, Math.round(width * shrink)), height: Math.max(1, Math.round(height * shrink)) };
  }

  /** Width / height; 1 if unknown. */
  get aspect(): number {
    const { width, height } = this.#deviceSize ?? { width: 0, height: 0 };
    return width > 0 && height > 0 ? width / height : 1;
  }

  /** Whether there is certainly no pixel to draw, as with `display: none`. */
  get isEmpty(): boolean {
    if (this.#canvas === null) return false;
    const { width, height } = this.#deviceSize ?? {
      width: this.#canvas.clientWidth,
      height: this.#canvas.clientHeight,
    };
    return width === 0 || height === 0;
  }

  /** Device pixels per CSS pixel; scripts of the page may have replaced it by any value. */
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
    // The canvas may have been replaced.
    if (canvas !== this.#canvas) this.hostDisconnected();
    this.#canvas = canvas;
    if (this.#canvas === null || this.#observer !== undefined) return;
    const { ResizeObserver } = windowOf(this.#canvas);
    if (!ResizeObserver) return this.#setFromCss(this.#canvas.clientWidth, this.#canvas.clientHeight);
    this.#observer = new ResizeObserver((entries) => this.#update(entries[entries.length - 1]));
    try {
      // Exact device pixels, even if the element's edges lie between them.
      this.#observer.observe(this.#canvas, { box: 'device-pixel-content-box' });
    } catch {
      // Safari does not support device-pixel boxes: it gets CSS pixels, and a listener for changes of the ratio.
      this.#observer.observe(this.#canvas);
      this.#watchResolution();
    }
  }

  #update(entry: ResizeObserverEntry): void {
    const exact = entry.devicePixelContentBoxSize?.[0];
    const { width, height } = entry.contentRect;
    // Under an emulated pixel ratio (DevTools, Playwright) Chromium reports CSS pixels as device pixels.
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
