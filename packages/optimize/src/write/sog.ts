import { GaussianSplatError, shCoefficientCount, type GaussianCloud } from '@gaussian-splat/core';
import { assetOfCredits, upright } from '@gaussian-splat/formats';
import { packedOrder } from '@gaussian-splat/renderer/tools';
import type { SplatVisibility } from '../pages/splat-visibility.js';
import type { Steps } from '../steps.js';
import { requireAtMost } from './file-bytes.js';
import { findPalette, type Palette } from './palette.js';
import { addedBy, DIGITS, roundPalette, weightsOf } from './sog-palette.js';
import { writeZip } from './zip.js';

/**
 * Encodes an image as lossless WebP, keeping the colors of transparent pixels.
 * @param rgba [height, width, 4]
 * @param effort 0 to 1: time to spend on a smaller file.
 */
export type EncodeWebp = (
  rgba: Uint8ClampedArray,
  width: number,
  height: number,
  effort: number,
) => Promise<Uint8Array>;

/**
 * Quantization steps: SOG stores bytes, and images with fewer values are smaller. Units: `place` 1/65,535 of the scene's
 * logarithmic box, rounded to a power of two, `size` octaves, `turn` and `opacity` 1/255 of their range, `color` and `harmonics` coefficients. The
 * step `harmonics` applies to the most visible splats; less visible ones have larger steps.
 */
export type SogSteps = Steps<'place' | 'size' | 'turn' | 'opacity' | 'color' | 'harmonics'>;

export interface SogOptions {
  readonly steps: SogSteps;
  /** Maximum number of entries of the palette of harmonics, at most 65,536. */
  readonly palette: number;
  readonly encodeWebp: EncodeWebp;
  /** Cache of palettes for the same cloud and order, by size. Palettes do not depend on the steps. */
  readonly palettes?: Map<number, Palette>;
  /**
   * Visibility of the cloud's splats: the palette represents harmonics of less visible splats less accurately. Default:
   * an estimate from opacities and sizes.
   */
  readonly seen?: SplatVisibility | undefined;
  /** Effort of {@link EncodeWebp}, 0..1; default 0.7. An effort of 1 takes twenty times as long for 1 % fewer bytes. */
  readonly effort?: number;
}

const USUAL_EFFORT = 0.7;
/** Largest code of a position along an axis: SOG stores 16 bits. */
const MAX_PLACES = 65_535;
const PALETTE_ROW = 64;
/** Maximum number of splats: WebP has at most 16,383 pixels a side, and the width is a multiple of 4. */
const MAX_SPLATS = 16_380 ** 2;
/** Largest code of a codebook, one byte. Steps that would need larger codes are enlarged. */
const MAX_CODES = 255;
const LN2 = Math.LN2;

/**
 * Writes SOG version 2 as a bundle, a ZIP archive. A scene with an up direction other than (0, -1, 0) is rotated.
 * @throws GaussianSplatError `argument/cloud` for a scene without usable splats.
 */
export async function writeSog(given: GaussianCloud, options: SogOptions): Promise<Uint8Array<ArrayBuffer>> {
  const cloud = upright(given);
  const order = packedOrder(cloud);
  if (order.length === 0) throw nothingToWrite();
  return writeZip(await sogFiles(cloud, order, options));
}

/**
 * Returns the files of a SOG by name, `meta.json` first.
 * @param order Indices of the splats to write, at least one, in the order of the file.
 * @throws GaussianSplatError `argument/value` for more splats than a WebP image has pixels.
 */
export async function sogFiles(
  cloud: GaussianCloud,
  order: Uint32Array,
  options: SogOptions,
): Promise<ReadonlyMap<string, Uint8Array>> {
  requireAtMost('SOG', order.length, MAX_SPLATS, 'splats');
  const { steps } = options;
  const images = new Map<string, Image>();
  const means = putMeans(cloud, order, steps.place, images);
  const { length } = order;
  const scales = codebook(length, 3, (n, k) => logScale(cloud.scales, order[n], k), LN2 * steps.size);
  const stride = 3 * shCoefficientCount(cloud.shDegree);
  const harmonics = cloud.shDegree > 0 ? harmonicsOf(cloud, order, options) : undefined;
  const colors = codebook(
    length,
    3,
    (n, k) => cloud.sh[stride * order[n] + k] - (harmonics?.added[3 * n + k] ?? 0),
    steps.color,
  );
  const opacities = Uint8Array.from(order, (i) => roundedByte(255 * cloud.opacities[i], steps.opacity));
  images.set(
    'scales.webp',
    ofSplats(order.length, (k, c) => (c < 3 ? scales.codes[3 * k + c] : 255)),
  );
  images.set('quats.webp', quatsOf(cloud, order, steps.turn));
  images.set(
    'sh0.webp',
    ofSplats(order.length, (k, c) => (c < 3 ? colors.codes[3 * k + c] : opacities[k])),
  );
  for (const [name, image] of harmonics?.images ?? []) images.set(name, image);
  const meta = {
    version: 2,
    count: order.length,
    antialias: cloud.antialiased,
    ...(cloud.antialiased && cloud.filterVariance === 0.1 && { model: 'antialiased' }),
    ...(cloud.hints?.order && { sortingMethod: cloud.hints.order }),
    ...(cloud.hints?.credits && { asset: assetOfCredits(cloud.hints.credits) }),
    means: { ...means, files: ['means_l.webp', 'means_u.webp'] },
    scales: { codebook: ofAllCodes(scales.values), files: ['scales.webp'] },
    quats: { files: ['quats.webp'] },
    sh0: { codebook: ofAllCodes(colors.values), files: ['sh0.webp'] },
    ...(harmonics && { shN: { ...harmonics.meta, files: ['shN_centroids.webp', 'shN_labels.webp'] } }),
  };
  const files = new Map<string, Uint8Array>([['meta.json', new TextEncoder().encode(JSON.stringify(meta))]]);
  for (const [name, { rgba, width, height }] of images) {
    files.set(name, await options.encodeWebp(rgba, width, height, options.effort ?? USUAL_EFFORT));
  }
  return files;
}

interface Image {
  readonly rgba: Uint8ClampedArray;
  readonly width: number;
  readonly height: number;
}

function imageOf(width: number, height: number): Image {
  return { rgba: new Uint8ClampedArray(4 * width * height), width, height };
}

/**
 * Returns an image with a pixel for each splat, in rows whose width is a multiple of 4.
 * @param channel Returns channel `c` (RGBA) of the splat at position `k`, 0..255.
 */
function ofSplats(count: number, channel: (k: number, c: number) => number): Image {
  const width = 4 * Math.ceil(Math.sqrt(count) / 4);
  const image = imageOf(width, Math.ceil(count / width));
  for (let k = 0; k < count; k++) for (let c = 0; c < 4; c++) image.rgba[4 * k + c] = channel(k, c);
  return image;
}

const roundedByte = (value: number, step: number): number =>
  Math.min(255, Math.max(0, Math.round(Math.round(value / step) * step)));

/** Minimum ratio of a splat's scales that is stored. Thinner splats look the same, but would widen the codebook. */
const THINNEST = 1e-4;

/** Returns the logarithm of scale `k` of splat `i`, which is finite also for the axes without extent of flat splats. */
function logScale(scales: Float32Array, i: number, k: number): number {
  const longest = Math.max(scales[3 * i], scales[3 * i + 1], scales[3 * i + 2]);
  return Math.log(Math.max(scales[3 * i + k], THINNEST * longest));
}

const logPlace = (x: number): number => Math.sign(x) * Math.log1p(Math.abs(x));

function putMeans(
  { positions, origin }: GaussianCloud,
  order: Uint32Array,
  step: number,
  images: Map<string, Image>,
): { mins: number[]; maxs: number[] } {
  const codes = new Uint16Array(3 * order.length);
  const [mins, maxs]: [number[], number[]] = [[], []];
  // A power of two, so that low bytes have few values. Multiples of 3, for example, have all 256 of them.
  const whole = 2 ** Math.max(0, Math.round(Math.log2(step)));
  for (let axis = 0; axis < 3; axis++) {
    const values = Float64Array.from(order, (i) => logPlace(positions[3 * i + axis] + origin[axis]));
    const low = values.reduce((min, value) => Math.min(min, value), Infinity);
    const high = values.reduce((max, value) => Math.max(max, value), -Infinity);
    mins.push(low);
    maxs.push(high);
    const scale = high > low ? MAX_PLACES / (high - low) : 0;
    values.forEach((value, k) => {
      codes[3 * k + axis] = Math.min(MAX_PLACES, whole * Math.round(((value - low) * scale) / whole));
    });
  }
  const byte = (shift: number) => (k: number, c: number) => (c < 3 ? (codes[3 * k + c] >> shift) & 255 : 255);
  images.set('means_l.webp', ofSplats(order.length, byte(0)));
  images.set('means_u.webp', ofSplats(order.length, byte(8)));
  return { mins, maxs };
}

/** Returns the image of rotations: RGB hold the three smaller components, alpha is 252 + the index of the largest. */
function quatsOf({ rotations }: GaussianCloud, order: Uint32Array, step: number): Image {
  const codes = new Uint8Array(4 * order.length);
  order.forEach((i, k) => {
    const q = rotations.subarray(4 * i, 4 * i + 4);
    let largest = 0;
    for (let n = 1; n < 4; n++) if (Math.abs(q[n]) > Math.abs(q[largest])) largest = n;
    const sign = q[largest] < 0 ? -1 : 1;
    let at = 4 * k;
    // Rounds relative to the center of the range, so that a component of 0 has the code 128 with any step.
    for (let n = 0; n < 4; n++) {
      if (n !== largest) codes[at++] = 128 + signedByte(sign * q[n] * Math.SQRT2 * 127.5 - 0.5, step);
    }
    codes[at] = 252 + largest;
  });
  return ofSplats(order.length, (k, c) => codes[4 * k + c]);
}

const signedByte = (value: number, step: number): number =>
  Math.min(127, Math.max(-128, Math.round(Math.round(value / step) * step)));

/**
 * Quantizes [length, width] numbers to at most 256 evenly spaced values.
 * @param of Returns number `k` of row `n`.
 * @param step Minimum distance of the values.
 * @returns The values, ascending, and for each number the index of the nearest value.
 */
function codebook(
  length: number,
  width: number,
  of: (n: number, k: number) => number,
  step: number,
): { values: number[]; codes: Uint8Array } {
  let [low, high] = [Infinity, -Infinity];
  for (let n = 0; n < length; n++) {
    for (let k = 0; k < width; k++) {
      const value = of(n, k);
      low = Math.min(low, value);
      high = Math.max(high, value);
    }
  }
  const spacing = Math.max(step, (high - low) / MAX_CODES) || 1;
  const count = Math.min(MAX_CODES, Math.ceil((high - low) / spacing)) + 1;
  const codes = new Uint8Array(width * length);
  for (let n = 0; n < length; n++) {
    for (let k = 0; k < width; k++) {
      codes[width * n + k] = Math.min(count - 1, Math.max(0, Math.round((of(n, k) - low) / spacing)));
    }
  }
  const values = Array.from({ length: count }, (_, code) => Number((low + spacing * code).toPrecision(DIGITS)));
  return { values, codes };
}

/** Returns a codebook of 256 values, as its specification wants; some readers refuse fewer. The last one is repeated. */
const ofAllCodes = (values: readonly number[]): number[] =>
  Array.from({ length: MAX_CODES + 1 }, (_, code) => values[Math.min(code, values.length - 1)]);

/** Encoded palette of harmonics: its properties in `meta.json`, its images, and its effect on colors. */
interface Harmonics {
  readonly meta: { readonly count: number; readonly bands: number; readonly codebook: readonly number[] };
  readonly images: ReadonlyMap<string, Image>;
  /** [N, 3] error of the visible colors in units of the constant coefficients, which compensate it. */
  readonly added: Float32Array;
}

function harmonicsOf(
  cloud: GaussianCloud,
  order: Uint32Array,
  { palette: size, seen, palettes, steps }: SogOptions,
): Harmonics {
  const { sh, shDegree } = cloud;
  const width = 3 * (shCoefficientCount(shDegree) - 1);
  const vectors = new Float32Array(width * order.length);
  order.forEach((i, k) => vectors.set(sh.subarray((width + 3) * i + 3, (width + 3) * (i + 1)), width * k));
  const weights = weightsOf(cloud, order, seen);
  const palette = palettes?.get(size) ?? findPalette(vectors, width, weights, size);
  palettes?.set(size, palette);
  const { codes, labels, values } = roundPalette(palette, { order, weights, seen, step: steps.harmonics });
  const image = imageOf((PALETTE_ROW * width) / 3, Math.ceil(palette.size / PALETTE_ROW));
  for (let entry = 0; entry < palette.size; entry++) {
    const first = ((Math.floor(entry / PALETTE_ROW) * PALETTE_ROW + (entry % PALETTE_ROW)) * width) / 3;
    for (let k = 0; k < width / 3; k++) {
      const at = 4 * (first + k);
      image.rgba.set([...codes.subarray(width * entry + 3 * k, width * entry + 3 * k + 3), 255], at);
    }
  }
  return {
    meta: { count: palette.size, bands: shDegree, codebook: ofAllCodes(values) },
    images: new Map([
      ['shN_centroids.webp', image],
      ['shN_labels.webp', ofSplats(order.length, (k, c) => [labels[k] & 255, labels[k] >> 8, 0, 255][c])],
    ]),
    added: addedBy((k, n) => values[codes[width * labels[k] + n]] - vectors[width * k + n], order, width, seen),
  };
}

export function nothingToWrite(): GaussianSplatError {
  return new GaussianSplatError('argument/cloud', {
    where: 'scene that is written as SOG',
    expected: '1 splat or more that can be drawn',
    found: '0',
    remedy: 'ask for a higher figure',
  });
}
