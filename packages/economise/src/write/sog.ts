import { GaussianSplatError, shCoefficientCount, type GaussianCloud } from '@gaussian-splat/core';
import { packedOrder, roundedBy, SeenRounder, weighSplats, type SeenSplats } from '@gaussian-splat/renderer';
import type { Steps } from '../allocate-steps.js';
import { findPalette, type Palette } from './palette.js';
import { writeZip } from './zip.js';

/**
 * Encodes an image as lossless WebP, pixels of alpha 0 with their colours.
 * @param rgba [height, width, 4]
 * @param effort 0 to 1: how much time there is to make it small
 */
export type EncodeWebp = (
  rgba: Uint8ClampedArray,
  width: number,
  height: number,
  effort: number,
) => Promise<Uint8Array>;

/**
 * Steps of what is rounded: SOG has bytes for all of it, and images of fewer values are smaller. `place` in 1/65,535 of the scene's logarithmic box, `size` in octaves, `turn` and `opacity` in 1/255,
 * `color` and `harmonics` in units of coefficients, the latter for splats that show much: in others it is larger.
 */
export type SogSteps = Steps<'place' | 'size' | 'turn' | 'opacity' | 'color' | 'harmonics'>;

export interface SogOptions {
  readonly steps: SogSteps;
  /** Entries of the palette of harmonics, at most 65,536. */
  readonly palette: number;
  readonly encodeWebp: EncodeWebp;
  /** Palettes that were found for the same cloud and order, by their sizes: those of other steps are the same. */
  readonly palettes?: Map<number, Palette>;
  /** How the splats of the cloud are seen: what shows little of their harmonics has a less fitting entry of the palette. Default: as opacities and sizes tell. */
  readonly seen?: SeenSplats | undefined;
  /** See {@link EncodeWebp}; default 0.7: with 1 it takes twenty times as long, for 1 % less. */
  readonly effort?: number;
}

const USUAL_EFFORT = 0.7;
/** As fine as SOG has it. */
const MOST_PLACES = 65_535;
const PALETTE_ROW = 64;
/** Codes of a codebook; where steps leave more, larger ones are taken. */
const MOST_CODES = 255;
/** The code of 0 in the palette; codes nearer to it than {@link EVEN_CODES} are evenly spaced, and the largest is at most {@link MOST_BENT} steps. */
const [MIDDLE_CODE, EVEN_CODES, MOST_BENT] = [127, 48, 2000];
/** The entry that has the usual step, so many weigh less; and how many octaves larger that of others is at most. */
const [REFERENCE_RANK, MOST_OCTAVES] = [0.9, 5];
/** Of the values of a codebook: more are more bytes, and finer than any step. */
const DIGITS = 6;
const LN2 = Math.LN2;

/** Writes SOG version 2 as a bundle. */
export async function writeSog(cloud: GaussianCloud, options: SogOptions): Promise<Uint8Array<ArrayBuffer>> {
  const order = packedOrder(cloud);
  if (order.length === 0) throw nothingToWrite();
  return writeZip(await sogFiles(cloud, order, options));
}

/**
 * The files of a SOG, by their names.
 * @param order indices of the splats that it holds, one or more, as they follow one another in it
 */
export async function sogFiles(
  cloud: GaussianCloud,
  order: Uint32Array,
  options: SogOptions,
): Promise<ReadonlyMap<string, Uint8Array>> {
  const { steps } = options;
  const images = new Map<string, Image>();
  const means = putMeans(cloud, order, steps.place, images);
  const { length } = order;
  const scales = codebook(length, 3, (n, k) => Math.log(cloud.scales[3 * order[n] + k]), LN2 * steps.size);
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
    ...(cloud.antialiased && { antialias: true }),
    ...(cloud.antialiased && cloud.filterVariance === 0.1 && { model: 'antialiased' }),
    means: { ...means, files: ['means_l.webp', 'means_u.webp'] },
    scales: { codebook: scales.values, files: ['scales.webp'] },
    quats: { files: ['quats.webp'] },
    sh0: { codebook: colors.values, files: ['sh0.webp'] },
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

/** An image with a pixel for each splat. */
function ofSplats(count: number, channel: (k: number, c: number) => number): Image {
  const width = 4 * Math.ceil(Math.sqrt(count) / 4);
  const image = imageOf(width, Math.ceil(count / width));
  for (let k = 0; k < count; k++) for (let c = 0; c < 4; c++) image.rgba[4 * k + c] = channel(k, c);
  return image;
}

const roundedByte = (value: number, step: number): number =>
  Math.min(255, Math.max(0, Math.round(Math.round(value / step) * step)));

const logPlace = (x: number): number => Math.sign(x) * Math.log1p(Math.abs(x));

function putMeans(
  { positions, origin }: GaussianCloud,
  order: Uint32Array,
  step: number,
  images: Map<string, Image>,
): { mins: number[]; maxs: number[] } {
  const codes = new Uint16Array(3 * order.length);
  const [mins, maxs]: [number[], number[]] = [[], []];
  // Whole numbers of codes, so that the lower bytes of places have few values.
  const whole = Math.max(1, Math.round(step));
  for (let axis = 0; axis < 3; axis++) {
    const values = Float64Array.from(order, (i) => logPlace(positions[3 * i + axis] + origin[axis]));
    const low = values.reduce((least, value) => Math.min(least, value), Infinity);
    const high = values.reduce((most, value) => Math.max(most, value), -Infinity);
    mins.push(low);
    maxs.push(high);
    const scale = high > low ? MOST_PLACES / (high - low) : 0;
    values.forEach((value, k) => {
      codes[3 * k + axis] = Math.min(MOST_PLACES, whole * Math.round(((value - low) * scale) / whole));
    });
  }
  const byte = (shift: number) => (k: number, c: number) => (c < 3 ? (codes[3 * k + c] >> shift) & 255 : 255);
  images.set('means_l.webp', ofSplats(order.length, byte(0)));
  images.set('means_u.webp', ofSplats(order.length, byte(8)));
  return { mins, maxs };
}

/** The three components besides the largest, which alpha names. */
function quatsOf({ rotations }: GaussianCloud, order: Uint32Array, step: number): Image {
  const codes = new Uint8Array(4 * order.length);
  order.forEach((i, k) => {
    const q = rotations.subarray(4 * i, 4 * i + 4);
    let largest = 0;
    for (let n = 1; n < 4; n++) if (Math.abs(q[n]) > Math.abs(q[largest])) largest = n;
    const sign = q[largest] < 0 ? -1 : 1;
    let at = 4 * k;
    // About the middle, so that what is not turned stays so.
    for (let n = 0; n < 4; n++) {
      if (n !== largest) codes[at++] = 128 + signedByte(sign * q[n] * Math.SQRT2 * 127.5 - 0.5, step);
    }
    codes[at] = 252 + largest;
  });
  return ofSplats(order.length, (k, c) => codes[4 * k + c]);
}

const signedByte = (value: number, step: number): number =>
  Math.min(127, Math.max(-128, Math.round(Math.round(value / step) * step)));

/** Evenly spaced values, and the nearest of them of each number. */
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
      if (!Number.isFinite(value)) continue;
      low = Math.min(low, value);
      high = Math.max(high, value);
    }
  }
  const spacing = Math.max(step, (high - low) / MOST_CODES) || 1;
  const count = Math.min(MOST_CODES, Math.ceil((high - low) / spacing)) + 1;
  const codes = new Uint8Array(width * length);
  for (let n = 0; n < length; n++) {
    for (let k = 0; k < width; k++) {
      codes[width * n + k] = Math.min(count - 1, Math.max(0, Math.round((of(n, k) - low) / spacing)));
    }
  }
  const values = Array.from({ length: count }, (_, code) => Number((low + spacing * code).toPrecision(DIGITS)));
  return { values, codes };
}

/** The palette of harmonics, as images and in `meta.json`, and what it adds to the colours that views see of each splat: its constant coefficient makes up for that. */
interface Harmonics {
  readonly meta: { readonly count: number; readonly bands: number; readonly codebook: readonly number[] };
  readonly images: ReadonlyMap<string, Image>;
  /** [N, 3] */
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
    meta: { count: palette.size, bands: shDegree, codebook: values },
    images: new Map([
      ['shN_centroids.webp', image],
      ['shN_labels.webp', ofSplats(order.length, (k, c) => [labels[k] & 255, labels[k] >> 8, 0, 255][c])],
    ]),
    added: addedBy((k, n) => values[codes[width * labels[k] + n]] - vectors[width * k + n], order, width, seen),
  };
}

interface RoundedPalette {
  /** [size, width], {@link MIDDLE_CODE} for 0 */
  readonly codes: Uint8Array;
  /** The entries have another order: those with equal steps are together, and in each such part as they are met first. */
  readonly labels: Uint32Array;
  /** The codebook. */
  readonly values: readonly number[];
}

/** Rounds entries, each as coarsely as what shows it allows, to what is seen of the splat that shows it most. */
function roundPalette(
  { entries, labels, size }: Palette,
  told: { order: Uint32Array; weights: Float32Array; seen: SeenSplats | undefined; step: number },
): RoundedPalette {
  const { order, weights, seen, step } = told;
  const width = entries.length / size;
  const sums = new Float32Array(size);
  const heaviest = new Uint32Array(size);
  const met: number[] = [];
  const isMet = new Uint8Array(size);
  labels.forEach((label, k) => {
    if (isMet[label] === 0) {
      met.push(label);
      [isMet[label], heaviest[label]] = [1, k];
    } else if (weights[k] > weights[heaviest[label]]) heaviest[label] = k;
    sums[label] += weights[k];
  });
  const reference = sums.slice().sort()[Math.floor(REFERENCE_RANK * (size - 1))];
  const octaves = Uint8Array.from(sums, (sum) =>
    Math.min(MOST_OCTAVES, Math.max(0, Math.round(Math.log2(reference / Math.max(1e-36, sum)) / 2))),
  );
  // Neighbours in the image with equal steps share codes.
  const numbers = new Uint32Array(size);
  met.sort((a, b) => octaves[a] - octaves[b]).forEach((entry, number) => (numbers[entry] = number));
  const scale = new CodeScale(
    step,
    entries.reduce((most, value) => Math.max(most, Math.abs(value)), 0),
  );
  const codes = new Uint8Array(entries.length);
  const rounder = new SeenRounder(width / 3 + 1, seen);
  for (let entry = 0; entry < size; entry++) {
    const unit = 2 ** octaves[entry];
    const [from, to] = [width * entry, width * numbers[entry]];
    rounder.round(
      order[heaviest[entry]],
      (k) => entries.subarray(from + 3 * (k - 1), from + 3 * k) as unknown as readonly number[],
      (value, weight, k, n) => {
        const code = Math.sign(value) * scale.codeOf(Math.abs(value), unit, weight);
        codes[to + 3 * (k - 1) + n] = MIDDLE_CODE + code;
        return scale.valueOf(code);
      },
    );
  }
  const values = Array.from({ length: 2 * MIDDLE_CODE + 1 }, (_, k) =>
    Number(scale.valueOf(k - MIDDLE_CODE).toPrecision(DIGITS)),
  );
  return { codes, labels: labels.map((label) => numbers[label]), values };
}

/** Values of codes -127 to 127: so many steps, and where that does not reach far enough, farther apart the farther from 0. */
class CodeScale {
  readonly #step: number;
  readonly #bend: number;

  constructor(step: number, most: number) {
    this.#step = Math.max(step, most / MOST_BENT);
    this.#bend = Math.max(0, most / this.#step - MIDDLE_CODE) / (MIDDLE_CODE - EVEN_CODES) ** 2;
  }

  valueOf(code: number): number {
    const size = Math.abs(code);
    return Math.sign(code) * this.#step * (size + this.#bend * Math.max(0, size - EVEN_CODES) ** 2);
  }

  /** @param unit codes are multiples of it */
  codeOf(value: number, unit: number, weight: number): number {
    const steps = value / this.#step - EVEN_CODES;
    const bent = this.#bend > 0 && steps > 0 ? (Math.sqrt(1 + 4 * this.#bend * steps) - 1) / (2 * this.#bend) : steps;
    const code = unit * roundedBy((EVEN_CODES + bent) / unit, weight);
    return Math.min(code, unit * Math.floor(MIDDLE_CODE / unit));
  }
}

/** What an error of each splat shows. */
function weightsOf(
  { opacities, scales }: GaussianCloud,
  order: Uint32Array,
  seen: SeenSplats | undefined,
): Float32Array {
  const usual = Float32Array.from(order, (i) => {
    const [a, b, c] = scales.subarray(3 * i, 3 * i + 3);
    // Opacity squared, times the area.
    return opacities[i] ** 2 * (Math.max(a * b, b * c, a * c) + 1e-20);
  });
  return seen
    ? weighSplats(
        usual,
        Float32Array.from(order, (i) => seen.energies[i]),
      ).weights
    : usual;
}

/**
 * Constant coefficients of the colours that views see of some harmonics, in the mean: with M the mean of Y Yᵀ, the sum of M_j0 / M_00 times coefficient j; a root of M has the same quotients in its first column.
 * @param of coefficient and channel `n` of the splat at place k of the order
 */
function addedBy(
  of: (k: number, n: number) => number,
  order: Uint32Array,
  width: number,
  seen: SeenSplats | undefined,
): Float32Array {
  const added = new Float32Array(3 * order.length);
  if (!seen?.roots.length) return added;
  const numbers = ((width / 3 + 1) * (width / 3 + 2)) / 2;
  order.forEach((i, k) => {
    if (!(seen.energies[i] > 0)) return;
    const root = seen.roots.subarray(numbers * i, numbers * (i + 1));
    for (let n = 0; n < width; n++) {
      const j = 1 + Math.floor(n / 3);
      added[3 * k + (n % 3)] += (root[(j * (j + 1)) / 2] / root[0]) * of(k, n);
    }
  });
  return added;
}

export function nothingToWrite(): GaussianSplatError {
  return new GaussianSplatError('argument/cloud', {
    where: 'scene that is written as SOG',
    expected: '1 splat or more that can be drawn',
    found: '0',
    remedy: 'ask for a higher figure',
  });
}
