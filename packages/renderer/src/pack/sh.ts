import { shCoefficientCount, type GaussianCloud } from '@gaussian-splat/core';
import { halfBits } from './half.js';
import { type ShPrecision, shWords } from './words.js';

/** Coefficients, three channels each, of bands 1, 2 and 3. */
export const BAND_SIZES = [3, 5, 7] as const;
/** Byte offset of the scale of each band in the data of a splat. */
export const SCALE_BYTES = [6, 7, 53] as const;
export const FIRST_CODE_BYTE = 8;
/** The scale of code k is 2^(k / 8 - 16). */
export const SCALE_STEPS = 8;
export const SCALE_BIAS = 16;
const MAX_CODE = 255;
const scaleOf = (code: number): number => 2 ** (code / SCALE_STEPS - SCALE_BIAS);

/**
 * Average PSNR of a single splat, rounded as `int8`, that {@link choosePrecision} requires: images then have 75 dB PSNR
 * or more.
 */
const INT8_NOISE_DB = 62;
/** The same in every block of neighbors: an image of that block alone then has about 63 dB. */
const INT8_PART_DB = 50;
/** Neighboring splats in a block, adjacent in packed order, and the number of samples among them. */
export const PART = 256;
const PART_SAMPLES = 8;

/** Variance of a splat's color from rounding to `int8`. */
export type NoiseOf = (splat: number) => number;

/** {@link NoiseOf} the splats of a cloud. */
export function noiseIn({ sh, shDegree }: Pick<GaussianCloud, 'sh' | 'shDegree'>): NoiseOf {
  const bits = bitsOf(sh);
  const numbers = 3 * shCoefficientCount(shDegree);
  return (splat) => {
    let noise = 0;
    let first = splat * numbers + 3;
    for (let band = 0; band < shDegree; band++) {
      const end = first + 3 * BAND_SIZES[band];
      noise += BAND_SIZES[band] * CODE_NOISE[scaleCodeOf(bits, first, end)];
      first = end;
    }
    return noise;
  };
}

/**
 * Returns `int8` if it is precise enough, in the whole scene and in each block of neighbors: coefficients are rounded
 * to within s / 254, s the scale of their band, evenly distributed; from a random direction, band b adds a variance of
 * (s / 127)² / 12 · (2b + 1) / 4π.
 */
export function choosePrecision(noiseOf: NoiseOf, kept: Uint32Array): ShPrecision {
  const parts = Math.max(1, Math.round(kept.length / PART));
  let sum = 0;
  let worst = 0;
  for (let part = 0; part < parts; part++) {
    const first = Math.floor((part * kept.length) / parts);
    const end = Math.floor(((part + 1) * kept.length) / parts);
    const variance = meanNoise(noiseOf, kept, first, end);
    sum += variance;
    worst = Math.max(worst, variance);
  }
  return precisionFor(sum / parts, worst);
}

/** Precision of a scene by the mean noise of all its splats, and of those of its noisiest block. */
export function precisionFor(mean: number, worst: number): ShPrecision {
  return mean <= 10 ** (-INT8_NOISE_DB / 10) && worst <= 10 ** (-INT8_PART_DB / 10) ? 'int8' : 'float16';
}

/** Mean noise over a sample of the splats of a block. */
function meanNoise(noiseOf: NoiseOf, kept: Uint32Array, first: number, end: number): number {
  const step = Math.max(1, Math.floor((end - first) / PART_SAMPLES));
  let noise = 0;
  let samples = 0;
  for (let k = first; k < end; k += step, samples++) noise += noiseOf(kept[k]);
  return noise / Math.max(1, samples);
}

/** The variance that a coefficient of a band adds, for each code of its scale. No scale is larger than the last. */
export const CODE_NOISE = Float64Array.from(
  { length: MAX_CODE + 1 },
  (_, code) => code && (code < MAX_CODE ? (scaleOf(code) / 127) ** 2 / (48 * Math.PI) : Infinity),
);

/**
 * Packs the coefficients of the splats `kept`, in the order [coefficient][channel], padded to 8 bytes for each splat.
 *
 * `float16`: all of them. `int8`: the three of degree 0 in float16, then for each band a scale (the largest magnitude
 * of the band, rounded up to an eighth of an octave) and its coefficients as multiples of 1/127 of that scale.
 */
export function packSh(cloud: GaussianCloud, kept: Uint32Array, precision: ShPrecision): Uint32Array {
  return precision === 'float16' ? packHalf(cloud, kept) : packInt8(cloud, kept);
}

function packHalf({ sh, shDegree }: GaussianCloud, kept: Uint32Array): Uint32Array {
  const numbers = 3 * shCoefficientCount(shDegree);
  const stride = 2 * shWords(shDegree, 'float16');
  const halves = new Uint16Array(kept.length * stride);
  let at = 0;
  for (const i of kept) {
    for (let k = 0; k < numbers; k++) halves[at + k] = halfBits(sh[i * numbers + k]);
    at += stride;
  }
  return new Uint32Array(halves.buffer);
}

/**
 * Factor from a coefficient to its code, for each code of a scale: 0 for bands that are too small or too large for any.
 */
const PER_UNIT = Float64Array.from({ length: MAX_CODE + 1 }, (_, code) =>
  code && code < MAX_CODE ? 127 / scaleOf(code) : 0,
);

function packInt8({ sh, shDegree }: GaussianCloud, kept: Uint32Array): Uint32Array {
  const numbers = 3 * shCoefficientCount(shDegree);
  const words = new Uint32Array(kept.length * shWords(shDegree, 'int8'));
  const bytes = new Uint8Array(words.buffer);
  const halves = new Uint16Array(words.buffer);
  const stride = 4 * shWords(shDegree, 'int8');
  const bits = bitsOf(sh);
  let at = 0;
  for (const splat of kept) {
    let first = splat * numbers;
    for (let channel = 0; channel < 3; channel++) halves[at / 2 + channel] = halfBits(sh[first++]);
    let code = at + FIRST_CODE_BYTE;
    for (let band = 0; band < shDegree; band++) {
      let end = first + 3 * BAND_SIZES[band];
      const scaleCode = scaleCodeOf(bits, first, end);
      const perUnit = PER_UNIT[scaleCode];
      bytes[at + SCALE_BYTES[band]] = scaleCode;
      // Degree 1 has nine codes but eight places: the last one replaces the scale of band 2.
      if (shDegree === 1) bytes[at + SCALE_BYTES[1]] = codeOf(sh[--end] * perUnit);
      while (first < end) bytes[code++] = codeOf(sh[first++] * perUnit);
    }
    at += stride;
  }
  return words;
}

/**
 * Rounds to the nearest 1/127 of the scale, halves up. Truncation rounds down above 0, and bytes keep the lower 8 bits
 * of a sum with 256.
 */
const codeOf = (value: number): number => (value + 256.5) | 0;

const bitsOf = ({ buffer, byteOffset, length }: Float32Array): Int32Array => new Int32Array(buffer, byteOffset, length);

/**
 * Bits of the largest number that a scale covers. The factor is slightly below 1 because a number equal to a step must
 * not round up to the next one.
 */
const MAX_BITS = bitsOf(Float32Array.from({ length: MAX_CODE }, (_, code) => scaleOf(code + 1e-6)));
/** The upper 12 bits of a float32, for a scale of code 0. */
const FIRST_EIGHTH = (127 - SCALE_BIAS) * SCALE_STEPS;

/** Code of the scale for finite coefficients, given by their bits, which sort by magnitude; 0 means all zeros. */
function scaleCodeOf(bits: Int32Array, first: number, end: number): number {
  let largest = 0;
  for (let k = first; k < end; k++) {
    const size = bits[k] & 0x7fffffff;
    if (size > largest) largest = size;
  }
  // The first estimate is not too large, because log2(1 + m) is at least m for m in 0..1.
  let code = Math.max(0, (largest >>> 20) - FIRST_EIGHTH);
  while (largest > MAX_BITS[code]) code++;
  return Math.min(MAX_CODE, code);
}
