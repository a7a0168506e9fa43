/**
 * Duration of the crossfade from a frame with fewer pixels to the full-resolution image, ms: too short for a noticeable
 * delay, long enough not to look like a cut.
 */
export const FADE_MS = 100;

/**
 * Overlays the full-resolution image with the last frame of a motion and fades it out. The blend weights sum to 1, as
 * in view transitions, so that translucent pixels keep their alpha.
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
   * Overlays a canvas with a copy of the frame drawn in the current task.
   * @returns a promise that fulfills when the overlay is shown, or when it cannot be
   */
  async cover(canvas: HTMLCanvasElement): Promise<void> {
    this.end();
    this.#state = 'awaited';
    const frame = await createImageBitmap(canvas).catch(() => undefined);
    if (this.#state !== 'awaited') return frame?.close();
    this.#state = 'covering';
    if (frame) this.#overlay = overlayOf(canvas, frame);
  }

  /** Starts the fade once the canvas shows the full-resolution image. */
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

/** A canvas with the same style that shows a frame; it takes over the bitmap's memory. */
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
