import { shCoefficientCount, type GaussianCloud } from '@gaussian-splat/core';
import { halfBits } from './half.js';
import { type ShPrecision, shWords } from './words.js';

/** Number of coefficients of bands 1, 2 and 3; each has three channels. */
export const BAND_SIZES = [3, 5, 7] as const;
/** Byte offset of the scale of each band in the data of a splat. */
export const SCALE_BYTES = [6, 7, 53] as const;
export const FIRST_CODE_BYTE = 8;
/** Steps of a scale in an octave: the scale of code k is 2^(k / 8 - 16). */
export const SCALE_STEPS = 8;
export const SCALE_BIAS = 16;
const MAX_CODE = 255;
const scaleOf = (code: number): number => 2 ** (code / SCALE_STEPS - SCALE_BIAS);

/**
 * Minimum average PSNR of a single splat rounded as `int8`, in decibels, for which {@link choosePrecision} selects
 * `int8`. Images then have a PSNR of 75 dB or more.
 */
const INT8_NOISE_DB = 62;
/**
 * Minimum average PSNR of the splats, in decibels, in every block of neighbors. An image of that block alone then has about 63
 * dB.
 */
const INT8_PART_DB = 50;
/** Number of neighboring splats in a block; they are adjacent in the packed order. */
const PART = 256;
/** Number of sampled splats in a block. */
const PART_SAMPLES = 8;

/** Returns the variance that rounding to `int8` adds to the color of a splat, by its index in the packed order. */
export type NoiseOf = (k: number) => number;

/** Returns the function {@link NoiseOf} for the splats `kept` of a cloud. */
export function noiseIn({ sh, shDegree }: Pick<GaussianCloud, 'sh' | 'shDegree'>, kept: Uint32Array): NoiseOf {
  const bits = bitsOf(sh);
  const numbers = 3 * shCoefficientCount(shDegree);
  return (k) => {
    let noise = 0;
    let first = kept[k] * numbers + 3;
    for (let band = 0; band < shDegree; band++) {
      const end = first + 3 * BAND_SIZES[band];
      noise += BAND_SIZES[band] * CODE_NOISE[scaleCodeOf(bits, first, end)];
      first = end;
    }
    return noise;
  };
}

/**
 * Returns `int8` if it is precise enough in the whole scene and in each block of neighbors, otherwise `float16`.
 * Rounding errors of coefficients are at most s / 254, evenly distributed, for the scale s of their band. From a random
 * direction, band b adds a variance of (s / 127)² / 12 · (2b + 1) / 4π.
 */
export function choosePrecision(noiseOf: NoiseOf, count: number): ShPrecision {
  const parts = Math.max(1, Math.round(count / PART));
  let sum = 0;
  let worst = 0;
  for (let part = 0; part < parts; part++) {
    const first = Math.floor((part * count) / parts);
    const end = Math.floor(((part + 1) * count) / parts);
    const variance = meanNoise(noiseOf, first, end);
    sum += variance;
    worst = Math.max(worst, variance);
  }
  return precisionFor(sum / parts, worst);
}

/**
 * Returns `int8` if its noise is within {@link INT8_NOISE_DB} for the scene and within {@link INT8_PART_DB} for the
 * noisiest block, otherwise `float16`.
 * @param mean Mean noise of `int8` over all splats, a variance.
 * @param worst Mean noise of `int8` in the noisiest block, a variance.
 */
function precisionFor(mean: number, worst: number): ShPrecision {
  return mean <= 10 ** (-INT8_NOISE_DB / 10) && worst <= 10 ** (-INT8_PART_DB / 10) ? 'int8' : 'float16';
}

/** Returns the mean noise over a sample of the splats in a block. */
function meanNoise(noiseOf: NoiseOf, first: number, end: number): number {
  const step = Math.max(1, Math.floor((end - first) / PART_SAMPLES));
  let noise = 0;
  let samples = 0;
  for (let k = first; k < end; k += step, samples++) noise += noiseOf(k);
  return noise / Math.max(1, samples);
}

/**
 * Variance that a coefficient of a band adds, for each code of the scale of the band; Infinity for the last code, which
 * no scale exceeds.
 */
export const CODE_NOISE = Float64Array.from(
  { length: MAX_CODE + 1 },
  (_, code) => code && (code < MAX_CODE ? (scaleOf(code) / 127) ** 2 / (48 * Math.PI) : Infinity),
);

/**
 * Packs the coefficients of the splats `kept`, in the order [coefficient][channel], padded to 8 bytes for each splat.
 *
 * `float16` stores all coefficients. `int8` stores the three of degree 0 in float16. Each band then has a scale (the
 * largest magnitude of the band, rounded up to an eighth of an octave), and its coefficients as multiples of 1/127 of
 * that scale.
 */
export function packSh(cloud: GaussianCloud, kept: Uint32Array, precision: ShPrecision): Uint32Array {
  const stride = shWords(cloud.shDegree, precision);
  const words = new Uint32Array(kept.length * stride);
  (precision === 'float16' ? packHalf : packInt8)(cloud, kept, words.buffer, 4 * stride);
  return words;
}

/** Writes the splats `kept`, every `stride` bytes. */
type Packer = (cloud: GaussianCloud, kept: Uint32Array, buffer: ArrayBuffer, stride: number) => void;

const packHalf: Packer = ({ sh, shDegree }, kept, buffer, stride) => {
  let at = 0;
  const numbers = 3 * shCoefficientCount(shDegree);
  const halves = new Uint16Array(buffer);
  for (const i of kept) {
    for (let k = 0; k < numbers; k++) halves[at / 2 + k] = halfBits(sh[i * numbers + k]);
    at += stride;
  }
};

/**
 * Factor from a coefficient to its code, for each code of a scale; 0 for bands that are too small or too large for a
 * scale.
 */
export const PER_UNIT = Float64Array.from({ length: MAX_CODE + 1 }, (_, code) =>
  code && code < MAX_CODE ? 127 / scaleOf(code) : 0,
);

const packInt8: Packer = ({ sh, shDegree }, kept, buffer, stride) => {
  let at = 0;
  const numbers = 3 * shCoefficientCount(shDegree);
  const bytes = new Uint8Array(buffer);
  const halves = new Uint16Array(buffer);
  const bits = bitsOf(sh);
  for (const splat of kept) {
    let first = splat * numbers;
    for (let channel = 0; channel < 3; channel++) halves[at / 2 + channel] = halfBits(sh[first++]);
    let code = at + FIRST_CODE_BYTE;
    for (let band = 0; band < shDegree; band++) {
      let end = first + 3 * BAND_SIZES[band];
      const scaleCode = scaleCodeOf(bits, first, end);
      const perUnit = PER_UNIT[scaleCode];
      bytes[at + SCALE_BYTES[band]] = scaleCode;
      // Degree 1 has nine codes but eight places: the last code replaces the scale of band 2.
      if (shDegree === 1) bytes[at + SCALE_BYTES[1]] = codeOf(sh[--end] * perUnit);
      while (first < end) bytes[code++] = codeOf(sh[first++] * perUnit);
    }
    at += stride;
  }
};

/**
 * Rounds to the nearest integer, halves up: codes are multiples of 1/127 of the scale. Truncation rounds down above 0,
 * and bytes keep the lower 8 bits of the sum with 256.
 */
const codeOf = (value: number): number => (value + 256.5) | 0;

const bitsOf = ({ buffer, byteOffset, length }: Float32Array): Int32Array => new Int32Array(buffer, byteOffset, length);

/**
 * Bits of the largest float32 that the scale of each code covers. The added 1e-6 prevents a number that equals a scale
 * from rounding up to the next one.
 */
export const MAX_BITS = bitsOf(Float32Array.from({ length: MAX_CODE }, (_, code) => scaleOf(code + 1e-6)));
/** Upper 12 bits of the float32 that equals the scale of code 0. */
const FIRST_EIGHTH = (127 - SCALE_BIAS) * SCALE_STEPS;

/**
 * Returns the code of the scale for finite coefficients, given by their bits, which sort by magnitude; 0 if all are
 * zero.
 */
function scaleCodeOf(bits: Int32Array, first: number, end: number): number {
  let largest = 0;
  for (let k = first; k < end; k++) {
    const size = bits[k] & 0x7fffffff;
    if (size > largest) largest = size;
  }
  // The first estimate is never too large, because log2(1 + m) is at least m for m in 0..1.
  let code = Math.max(0, (largest >>> 20) - FIRST_EIGHTH);
  while (largest > MAX_BITS[code]) code++;
  return Math.min(MAX_CODE, code);
}
