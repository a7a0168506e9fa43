/** 8-bit PNG files to and from numbers of 0..1. */
import { PNG } from 'pngjs';

export interface PngImage {
  readonly width: number;
  readonly height: number;
  /** [height, width, 3] red, green, blue in 0..1, rows from the top; not multiplied by alpha, as PNG has it. */
  readonly color: Float64Array;
  /** [height, width] in 0..1. */
  readonly alpha: Float64Array;
}

/** Reads an 8-bit PNG; throws on 16-bit files, whose precision would be lost silently. */
export function readPng(bytes: Uint8Array): PngImage {
  const png = PNG.sync.read(Buffer.from(bytes)) as PNG & { readonly depth?: number };
  if (png.depth !== 8) throw new RangeError(`expected a PNG of 8 bits to a channel, found ${png.depth}`);
  const { width, height, data } = png;
  const color = new Float64Array(3 * width * height);
  const alpha = new Float64Array(width * height);
  for (let pixel = 0; pixel < alpha.length; pixel++) {
    for (let channel = 0; channel < 3; channel++) color[3 * pixel + channel] = data[4 * pixel + channel] / 255;
    alpha[pixel] = data[4 * pixel + 3] / 255;
  }
  return { width, height, color, alpha };
}

/** Writes an 8-bit RGBA PNG: values are clamped to 0..1 and rounded to the nearest level. Opaque without alpha. */
export function writePng(image: Omit<PngImage, 'alpha'> & { readonly alpha?: Float64Array }): Uint8Array {
  const { width, height, color, alpha } = image;
  const png = new PNG({ width, height });
  for (let pixel = 0; pixel < width * height; pixel++) {
    for (let channel = 0; channel < 3; channel++) png.data[4 * pixel + channel] = toByte(color[3 * pixel + channel]);
    png.data[4 * pixel + 3] = toByte(alpha ? alpha[pixel] : 1);
  }
  return new Uint8Array(PNG.sync.write(png));
}

const toByte = (value: number): number => Math.round(255 * Math.min(1, Math.max(0, value)));
