/** Takes images for scripts: of any size, with a background color and the CSS filters of the element. */
import { loadModule, type Credits } from '@gaussian-splat/core';
import type { PixelSize } from '../../viewer/size-controller.js';
import type { Viewer } from '../../viewer/viewer.js';
import type { Backend } from '../../gpu/backend.js';
import type { DepthOptions, MeasuredView } from './depth-image.js';

/** Options of `toBlob()`. */
export interface ImageOptions {
  /** Media type of the image. Default `image/png`. */
  readonly mimeType?: string;
  /** Quality of lossy formats such as `image/jpeg`, 0..1. */
  readonly qualityArgument?: number;
  /**
   * Width of the image, pixels. Default: the drawn size of the element. If only one of `width` and `height` is set, the
   * image keeps the aspect ratio.
   */
  readonly width?: number;
  readonly height?: number;
  /** CSS color behind the scene. Default: transparent. */
  readonly background?: string;
}

export { record, recordFrames } from './recording.js';

/** Measures depth and identity, with code that is loaded at the first call. */
export async function renderDepth(host: Viewer, options: DepthOptions): Promise<MeasuredView> {
  const { measureDepth } = await loadModule('the code that measures depth', () => import('./depth-image.js'));
  return measureDepth(host, options);
}

/** Color with premultiplied alpha, each component 0..1. */
export type Rgba = readonly [red: number, green: number, blue: number, alpha: number];

/** Maximum number of runs of the post-processor that an image waits for. A page that moves may need another each time. */
const MAX_RUNS = 10;
/** Message for an image whose device was lost. */
const LOST = 'The GPU device was lost before the image was drawn: take it again after the event contextrestored';

export async function takeImage(host: Viewer, options: ImageOptions): Promise<Blob> {
  const { mimeType = 'image/png', qualityArgument, background } = options;
  await host.present();
  const { backend } = host.view;
  const pixels = backend && sizeOf(options, host.canvas, backend.place.limits.maxTextureDimension2D);
  const color = background === undefined ? undefined : rgbaOf(background);
  const draw = (): HTMLCanvasElement => {
    // A post-processor gets the frame without a color behind it, as in the page.
    const isFiltered = host.view.backend?.filter !== undefined;
    const canvas = host.drawNow(pixels ?? undefined, isFiltered ? undefined : color);
    if (canvas === null) throw nothingToDraw();
    return isFiltered && color ? onColor(canvas, background!) : canvas;
  };
  // Draws the frame of the page again. Browsers present a canvas only after this task, so the image does not flash.
  const restore = (): void => {
    if (pixels || color) host.drawNow();
  };
  let drawn = draw();
  // The post-processor needs more time than this task, and a run for another frame may come first.
  for (let tries = 0; host.view.backend?.filter?.isPending && tries < MAX_RUNS; tries++) {
    restore();
    await host.view.backend.filter.idle;
    drawn = draw();
  }
  const blob = new Promise<Blob | null>((resolve) =>
    withFilters(host, drawn).toBlob(resolve, mimeType, qualityArgument),
  );
  restore();
  backend?.filter?.forgetCapture();
  const taken = await blob;
  // If the device was lost before drawing, the image is empty, and the loss is reported only later.
  if (backend && (await wasLost(backend))) throw new DOMException(LOST, 'InvalidStateError');
  if (taken === null) throw new DOMException(`The image could not be written as ${mimeType}`, 'EncodingError');
  const { credits = [] } = host.features.get<Credited>('credits').value ?? {};
  if (credits.length === 0) return taken;
  const { withCredits } = await loadModule('the code that writes credits', () => import('./image-credits.js'));
  return withCredits(taken, credits);
}

/** Part of the feature `credits`. */
interface Credited {
  readonly credits: readonly Credits[];
}

/** Waits for all submitted work, then returns whether the device is lost. */
async function wasLost(backend: Pick<Backend, 'finished' | 'place'>): Promise<boolean> {
  await backend.finished();
  // The loss is reported in a later task.
  await new Promise((resolve) => setTimeout(resolve));
  return backend.place.isLost;
}

export const nothingToDraw = (): DOMException =>
  new DOMException('There is no frame to save: expected a loaded scene in an element with a size', 'InvalidStateError');

/**
 * Size of the image, pixels. One side alone keeps the aspect ratio of the element.
 * @returns null if neither side is given
 * @throws RangeError for a size that the GPU cannot draw
 */
export function sizeOf(
  { width, height }: ImageOptions,
  canvas: HTMLCanvasElement | null,
  max: number,
  method = 'toBlob',
): PixelSize | null {
  if (canvas === null || (width === undefined && height === undefined)) return null;
  const aspect = canvas.width / canvas.height;
  const size = { width: Math.round(width ?? height! * aspect), height: Math.round(height ?? width! / aspect) };
  const isDrawable = (side: number): boolean => side >= 1 && side <= max;
  if (!isDrawable(size.width) || !isDrawable(size.height))
    throw new RangeError(
      `${method}(): expected an image of 1 to ${max} pixels to a side, which is what this GPU can draw, found ${size.width} x ${size.height}`,
    );
  return size;
}

function rgbaOf(color: string): Rgba {
  if (!CSS.supports('color', color))
    throw new TypeError(`toBlob(): expected a CSS color as background, found "${color}"`);
  const context = paper(1, 1);
  context.fillStyle = color;
  context.fillRect(0, 0, 1, 1);
  const [red, green, blue, alpha] = Array.from(context.getImageData(0, 0, 1, 1).data, (value) => value / 255);
  return [red * alpha, green * alpha, blue * alpha, alpha];
}

function onColor(drawn: HTMLCanvasElement, color: string): HTMLCanvasElement {
  const context = paper(drawn.width, drawn.height);
  context.fillStyle = color;
  context.fillRect(0, 0, drawn.width, drawn.height);
  context.drawImage(drawn, 0, 0);
  return context.canvas;
}

/**
 * Returns a copy of the canvas with the CSS filters of canvas and element applied, or the canvas itself if there are
 * none.
 */
function withFilters(host: Viewer, drawn: HTMLCanvasElement): HTMLCanvasElement {
  const filter = [host.canvas!, host.element]
    .map((node) => getComputedStyle(node).filter)
    .filter((text) => text !== '' && text !== 'none')
    .join(' ');
  if (filter === '') return drawn;
  const context = paper(drawn.width, drawn.height);
  if (!('filter' in context)) {
    host.warn(
      '<gaussian-splat> toBlob(): this browser cannot apply CSS filters to an image, so the image is without them.',
    );
    return drawn;
  }
  context.filter = filter;
  context.drawImage(drawn, 0, 0);
  return context.canvas;
}

function paper(width: number, height: number): CanvasRenderingContext2D {
  const context = Object.assign(document.createElement('canvas'), { width, height }).getContext('2d');
  if (context === null) throw nothingToDraw();
  return context;
}
