import type { ReactiveController, ReactiveControllerHost } from 'lit';

/**
 * Returns the window of a node's document, which may be an `<iframe>` or a popup. Falls back to the page's own window.
 */
export const windowOf = ({ ownerDocument }: Node): Window & typeof globalThis =>
  (ownerDocument?.defaultView as (Window & typeof globalThis) | null | undefined) ?? window;

/**
 * Maximum plausible number of device pixels per CSS pixel: dense displays have 4, and the browser's zoom multiplies
 * them by at most 5.
 */
const MAX_RATIO = 20;

/** A size in device pixels, integers. */
export interface PixelSize {
  readonly width: number;
  readonly height: number;
}

/** Tracks the size of the frame in device pixels, through resizes, zoom and moves between screens. */
export class SizeController implements ReactiveController {
  readonly #canvasOf: () => HTMLCanvasElement | null;
  readonly #onChange: () => void;
  #canvas: HTMLCanvasElement | null = null;
  #observer: ResizeObserver | undefined;
  #resolution: MediaQueryList | undefined;
  #deviceSize: PixelSize | undefined;

  /**
   * @param canvasOf Returns the canvas; null until it is rendered.
   * @param onChange Called when the size has changed.
   */
  constructor(host: ReactiveControllerHost, canvasOf: () => HTMLCanvasElement | null, onChange: () => void) {
    this.#canvasOf = canvasOf;
    this.#onChange = onChange;
    host.addController(this);
  }

  /**
   * Returns the size of frames in pixels; null while there is no pixel to draw, or the size is unknown.
   * @param maxPixelRatio Maximum number of drawn pixels per CSS pixel.
   * @param maxSide Longest side of the device's textures, in pixels.
   */
  pixelSize(maxPixelRatio: number, maxSide: number): PixelSize | null {
    const { width, height } = this.#deviceSize ?? { width: 0, height: 0 };
    if (width === 0 || height === 0) return null;
    const shrink = Math.min(1, maxPixelRatio / this.#pixelRatio, maxSide / Math.max(width, height));
    return { width: Math.max(1, Math.round(width * shrink)), height: Math.max(1, Math.round(height * shrink)) };
  }

  /** Width of the frame divided by its height; 1 if they are unknown. */
  get aspect(): number {
    const { width, height } = this.#deviceSize ?? { width: 0, height: 0 };
    return width > 0 && height > 0 ? width / height : 1;
  }

  /** Whether the canvas certainly has no pixel, as with `display: none`; false if it is not rendered yet. */
  get isEmpty(): boolean {
    if (this.#canvas === null) return false;
    const { width, height } = this.#deviceSize ?? {
      width: this.#canvas.clientWidth,
      height: this.#canvas.clientHeight,
    };
    return width === 0 || height === 0;
  }

  /**
   * Device pixels per CSS pixel, 0..`MAX_RATIO`; 1 if a script of the page has replaced `devicePixelRatio` by an
   * invalid value.
   */
  get #pixelRatio(): number {
    const ratio = this.#canvas ? windowOf(this.#canvas).devicePixelRatio : devicePixelRatio;
    return ratio > 0 ? Math.min(ratio, MAX_RATIO) : 1;
  }

  hostConnected(): void {
    this.hostUpdated();
  }

  hostDisconnected(): void {
    this.#observer?.disconnect();
    this.#observer = undefined;
    this.#resolution?.removeEventListener('change', this.#onResolution);
    this.#resolution = undefined;
  }

  hostUpdated(): void {
    const canvas = this.#canvasOf();
    // A canvas that replaces another must be observed again.
    if (canvas !== this.#canvas) this.hostDisconnected();
    this.#canvas = canvas;
    if (this.#canvas === null || this.#observer !== undefined) return;
    const { ResizeObserver } = windowOf(this.#canvas);
    if (!ResizeObserver) return this.#setFromCss(this.#canvas.clientWidth, this.#canvas.clientHeight);
    this.#observer = new ResizeObserver((entries) => this.#update(entries[entries.length - 1]));
    try {
      // This box reports exact device pixels, even if the edges of the element lie between pixels.
      this.#observer.observe(this.#canvas, { box: 'device-pixel-content-box' });
    } catch {
      // Safari does not support device-pixel boxes. There the size is computed from CSS pixels, and again when the
      // pixel ratio changes.
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
