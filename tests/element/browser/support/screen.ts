/** Screenshots of the browser with compositing, and input as a person gives it. */
import { executeServerCommand } from '@web/test-runner-commands';
import { frames } from './harness.js';

export type Rgb = readonly [red: number, green: number, blue: number];

/** The colors that an element shows. */
export class Screen {
  readonly #data: ImageData;
  readonly #scale: number;

  constructor(data: ImageData, cssWidth: number) {
    this.#data = data;
    this.#scale = data.width / cssWidth;
  }

  /** Color at a point in the element's CSS pixels. */
  at(x: number, y: number): Rgb {
    const i = 4 * (Math.floor(y * this.#scale) * this.#data.width + Math.floor(x * this.#scale));
    const [red, green, blue] = this.#data.data.subarray(i, i + 3);
    return [red, green, blue];
  }

  /** Middle of all pixels that a rule picks, in CSS pixels; null if there is none. */
  middleOf(isPicked: (color: Rgb) => boolean): { x: number; y: number; count: number } | null {
    const { width, height, data } = this.#data;
    let [count, x, y] = [0, 0, 0];
    for (let i = 0; i < width * height; i++) {
      if (!isPicked([data[4 * i], data[4 * i + 1], data[4 * i + 2]])) continue;
      count++;
      x += (i % width) + 0.5;
      y += Math.floor(i / width) + 0.5;
    }
    return count === 0 ? null : { x: x / count / this.#scale, y: y / count / this.#scale, count };
  }

  /** Number of color values, 0..255, that differ from another image of the same size by more than a tolerance. */
  differences(other: Screen, tolerance = 0): number {
    const [a, b] = [this.#data.data, other.#data.data];
    return a.length !== b.length
      ? Infinity
      : a.reduce((sum, v, i) => sum + (Math.abs(v - b[i]) > tolerance ? 1 : 0), 0);
  }
}

export async function screenOf(element: Element): Promise<Screen> {
  await frames();
  const { x, y, width, height } = element.getBoundingClientRect();
  // A page whose thread is busy for 20 s gets the answer after its timeout.
  let tries = 10;
  const take = (): Promise<string> =>
    executeServerCommand<string, object>('screenshot', { x, y, width, height }).catch((error: unknown) => {
      if (tries-- > 0) return 'later';
      throw error;
    });
  let png = await take();
  while (png === 'later') png = await take();
  const bytes = Uint8Array.from(atob(png), (c) => c.charCodeAt(0));
  const image = await createImageBitmap(new Blob([bytes]));
  const context = new OffscreenCanvas(image.width, image.height).getContext('2d');
  if (context === null) throw new Error('no 2D canvas');
  context.drawImage(image, 0, 0);
  return new Screen(context.getImageData(0, 0, image.width, image.height), width);
}

/** Waits until an element shows content: images are decoded, pipelines compiled, and frames composited, asynchronously. */
export async function comesToShow(
  element: Element,
  isShown: (screen: Screen) => boolean,
  tries = 20,
): Promise<boolean> {
  const end = performance.now() + 30_000;
  for (let i = 0; i < tries || performance.now() < end; i++) if (isShown(await screenOf(element))) return true;
  return false;
}

export const isRed = ([r, g, b]: Rgb): boolean => r > 150 && g < 110 && b < 110;
export const isGreen = ([r, g, b]: Rgb): boolean => g > 150 && r < 110 && b < 110;
export const isBlue = ([r, g, b]: Rgb): boolean => b > 150 && r < 110 && g < 110;

export interface Finger {
  readonly x: number;
  readonly y: number;
  readonly id?: number;
}

/** One touch event with the fingers that are down. @param ms when it happened, since the epoch; undefined for now */
export const sendTouch = (
  type: 'touchStart' | 'touchMove' | 'touchEnd',
  points: readonly Finger[],
  ms?: number,
): Promise<unknown> => executeServerCommand('send-touch', { type, points, ms });

/** Taps of one finger, at times of their own: a busy machine does not draw them apart. */
export class Taps {
  #ms = Date.now();

  /** @param pauseMs since the tap before */
  async tap(x: number, y: number, pauseMs = 80): Promise<void> {
    await sendTouch('touchStart', [{ x, y, id: 1 }], (this.#ms += pauseMs));
    await sendTouch('touchEnd', [], (this.#ms += 40));
  }
}

export const turnWheel = (x: number, y: number, deltaY: number): Promise<unknown> =>
  executeServerCommand('turn-wheel', { x, y, deltaY });
