/** How long a frame of fewer pixels fades into the true image, ms: too short to be waited for, and long enough for a change that is not seen as a cut. */
export const FADE_MS = 100;

/**
 * Lays the last frame of a motion over the true image, and lets it fade. Both are added with weights whose sum is 1, as view transitions add them, so that what is translucent
 * stays as translucent as it is.
 */
export class Fade {
  #overlay: HTMLCanvasElement | undefined;
  #animations: readonly Animation[] = [];
  #state: 'none' | 'awaited' | 'covering' | 'fading' = 'none';

  /** The frame that it is to fade from is not there yet. */
  get isAwaited(): boolean {
    return this.#state === 'awaited';
  }

  get isCovering(): boolean {
    return this.#state === 'covering';
  }

  /**
   * Lays a copy of what was drawn in the running task over a canvas.
   * @returns a promise that fulfils when it lies there, or when nothing can
   */
  async cover(canvas: HTMLCanvasElement): Promise<void> {
    this.end();
    this.#state = 'awaited';
    const frame = await createImageBitmap(canvas).catch(() => undefined);
    if (this.#state !== 'awaited') return frame?.close();
    this.#state = 'covering';
    if (frame) this.#overlay = overlayOf(canvas, frame);
  }

  /** Begins to fade: the true image is on the canvas. */
  start(canvas: HTMLCanvasElement): void {
    const overlay = this.#overlay;
    if (this.#state !== 'covering') return;
    this.#state = 'fading';
    if (!overlay) return this.end();
    const surface = canvas.parentElement!;
    surface.style.isolation = 'isolate';
    overlay.style.mixBlendMode = 'plus-lighter';
    const timing = { duration: FADE_MS, fill: 'forwards' } as const;
    const fading = overlay.animate({ opacity: [1, 0] }, timing);
    this.#animations = [fading, canvas.animate({ opacity: [0, 1] }, { duration: FADE_MS })];
    fading.onfinish = () => this.#overlay === overlay && this.end();
  }

  /** Leaves the canvas as it is. */
  end(): void {
    this.#state = 'none';
    const overlay = this.#overlay;
    this.#overlay = undefined;
    if (!overlay) return;
    for (const animation of this.#animations) animation.cancel();
    this.#animations = [];
    overlay.parentElement?.style.removeProperty('isolation');
    overlay.remove();
  }
}

/** Whether a page's own style of the canvas lets two of them be added up. */
export function canFade(canvas: HTMLCanvasElement): boolean {
  const view = canvas.ownerDocument.defaultView;
  if (!view || !('animate' in canvas) || !CSS.supports('mix-blend-mode', 'plus-lighter')) return false;
  const { opacity, mixBlendMode, visibility } = view.getComputedStyle(canvas);
  return opacity === '1' && mixBlendMode === 'normal' && visibility === 'visible';
}

/** A canvas of the same look, which shows a frame; it takes over its memory. */
function overlayOf(canvas: HTMLCanvasElement, frame: ImageBitmap): HTMLCanvasElement | undefined {
  const overlay = canvas.ownerDocument.createElement('canvas');
  overlay.setAttribute('part', 'canvas');
  overlay.setAttribute('aria-hidden', 'true');
  [overlay.width, overlay.height] = [frame.width, frame.height];
  Object.assign(overlay.style, { position: 'absolute', inset: '0', pointerEvents: 'none' });
  const context = overlay.getContext('bitmaprenderer');
  if (!context) return undefined;
  context.transferFromImageBitmap(frame);
  canvas.after(overlay);
  return overlay;
}
