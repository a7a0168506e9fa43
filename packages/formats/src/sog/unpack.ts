import { shCoefficientCount } from '@gaussian-splat/core';
import { expInPlace, type DraftCloud } from '../cloud.js';
import type { SogMeta } from './meta.js';

/** Selection of splats to unpack: `count` splats, with indices that are multiples of `step`. */
export interface Selection {
  readonly count: number;
  readonly step: number;
}

const red = (pixel: number): number => (pixel >>> 16) & 255;
const green = (pixel: number): number => (pixel >>> 8) & 255;
const blue = (pixel: number): number => pixel & 255;
const alpha = (pixel: number): number => pixel >>> 24;

/**
 * Writes positions, [count, 3]. Their 16-bit codes, with low and high bytes in two planes, are sign(x)·ln(1 + |x|)
 * between bounds.
 */
export function unpackMeans(
  low: Uint32Array,
  high: Uint32Array,
  { mins, maxs }: SogMeta['means'],
  { count, step }: Selection,
  out: Float32Array,
): void {
  for (let i = 0; i < count; i++) {
    const [l, h] = [low[i * step], high[i * step]];
    for (let axis = 0, shift = 16; axis < 3; axis++, shift -= 8) {
      const code = ((l >>> shift) & 255) | (((h >>> shift) & 255) << 8);
      const value = mins[axis] + ((maxs[axis] - mins[axis]) * code) / 65_535;
      out[3 * i + axis] = Math.sign(value) * Math.expm1(Math.abs(value));
    }
  }
}

/**
 * Writes quaternions (w, x, y, z), [count, 4]. Alpha less 252 is the index of the largest component, which is not stored.
 * The other components are bytes, from -1/sqrt(2) to 1/sqrt(2).
 */
export function unpackQuats(plane: Uint32Array, { count, step }: Selection, out: Float32Array): void {
  for (let i = 0; i < count; i++) {
    const pixel = plane[i * step];
    const largest = alpha(pixel) - 252;
    // The rotation of an invalid code remains 0, so that the splat is dropped.
    if (largest < 0) continue;
    let squares = 0;
    for (let component = 0, shift = 16; component < 4; component++) {
      if (component === largest) continue;
      const value = (((pixel >>> shift) & 255) / 127.5 - 1) * Math.SQRT1_2;
      out[4 * i + component] = value;
      squares += value * value;
      shift -= 8;
    }
    out[4 * i + largest] = Math.sqrt(Math.max(0, 1 - squares));
  }
}

export function unpackScales(
  plane: Uint32Array,
  { values }: SogMeta['scales'],
  { count, step }: Selection,
  out: Float32Array,
): void {
  for (let i = 0; i < count; i++) {
    const pixel = plane[i * step];
    out[3 * i] = values[0][red(pixel)];
    out[3 * i + 1] = values[1][green(pixel)];
    out[3 * i + 2] = values[2][blue(pixel)];
  }
  expInPlace(out);
}

/** Writes constant coefficients and opacities of a cloud. */
export function unpackColors(
  plane: Uint32Array,
  { values }: SogMeta['sh0'],
  { count, step }: Selection,
  cloud: DraftCloud,
): void {
  const stride = 3 * shCoefficientCount(cloud.shDegree);
  const logits = values.at(3);
  for (let i = 0; i < count; i++) {
    const pixel = plane[i * step];
    cloud.sh[stride * i] = values[0][red(pixel)];
    cloud.sh[stride * i + 1] = values[1][green(pixel)];
    cloud.sh[stride * i + 2] = values[2][blue(pixel)];
    cloud.opacities[i] = logits ? 1 / (1 + Math.exp(-logits[alpha(pixel)])) : alpha(pixel) / 255;
  }
}

/**
 * Palette of coefficients above the constant one. A row of its image has 64 entries, with a pixel for each coefficient.
 * `size` is the number of entries, and `values` has the coefficient of each byte.
 */
export interface Palette {
  readonly pixels: Uint32Array;
  readonly size: number;
  readonly values: Float32Array;
}

/** Number of entries of the palette in a row of its image. */
export const PALETTE_ROW = 64;

/** Writes the coefficients of each splat's palette entry. Splats with a label beyond the palette keep zeros. */
export function unpackHarmonics(labels: Uint32Array, palette: Palette, cloud: DraftCloud): void {
  const coefficients = shCoefficientCount(cloud.shDegree) - 1;
  const entry = 3 * coefficients;
  const colors = new Float32Array(palette.size * entry);
  for (let k = 0; k < palette.size; k++) {
    const first = Math.floor(k / PALETTE_ROW) * PALETTE_ROW * coefficients + (k % PALETTE_ROW) * coefficients;
    for (let c = 0; c < coefficients; c++) {
      const pixel = palette.pixels[first + c];
      colors[k * entry + 3 * c] = palette.values[red(pixel)];
      colors[k * entry + 3 * c + 1] = palette.values[green(pixel)];
      colors[k * entry + 3 * c + 2] = palette.values[blue(pixel)];
    }
  }
  for (let i = 0; i < cloud.count; i++) {
    const label = red(labels[i]) | (green(labels[i]) << 8);
    if (label >= palette.size) continue;
    cloud.sh.set(colors.subarray(label * entry, (label + 1) * entry), i * (entry + 3) + 3);
  }
}
