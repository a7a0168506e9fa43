/**
 * Duration of the crossfade from a frame with fewer pixels to the full-resolution image, ms. It is too short for a
 * noticeable delay, and long enough not to look like a cut.
 */
export const FADE_MS = 100;

/**
 * Fades from the last frame of a motion to the full-resolution image. A copy of the frame lies over the canvas and
 * fades out. The weights of both add up to 1, as in view transitions, so that translucent pixels keep their alpha.
 */
export class Fade {
  #overlay: HTMLCanvasElement | undefined;
  #animations: readonly Animation[] = [];
  #state: 'none' | 'awaited' | 'covering' | 'fading' = 'none';

  /** Whether the copy of the last frame has been requested and has not arrived yet. */
  get isAwaited(): boolean {
    return this.#state === 'awaited';
  }

  get isCovering(): boolean {
    return this.#state === 'covering';
  }

  /**
   * Overlays a canvas with a copy of the frame that was drawn in the current task.
   * @returns A promise that resolves when the overlay is shown, or cannot be shown.
   */
  async cover(canvas: HTMLCanvasElement): Promise<void> {
    this.end();
    this.#state = 'awaited';
    const frame = await createImageBitmap(canvas).catch(() => undefined);
    if (this.#state !== 'awaited') return frame?.close();
    this.#state = 'covering';
    if (frame) this.#overlay = overlayOf(canvas, frame);
  }

  /** Starts the fade. Call when the canvas shows the full-resolution image. */
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

  /** Ends the fade at once: removes the overlay, and restores the style of the canvas. */
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

/** Returns whether the browser and the page's style of the canvas allow the overlay to be added to the canvas. */
export function canFade(canvas: HTMLCanvasElement): boolean {
  const view = canvas.ownerDocument.defaultView;
  if (!view || !('animate' in canvas) || !CSS.supports('mix-blend-mode', 'plus-lighter')) return false;
  const { opacity, mixBlendMode, visibility } = view.getComputedStyle(canvas);
  return opacity === '1' && mixBlendMode === 'normal' && visibility === 'visible';
}

/**
 * Returns a canvas over another one, with the same part name, that shows a frame. The canvas takes ownership of the
 * bitmap. Returns undefined if the browser does not support this.
 */
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
