import { shCoefficientCount, type ShDegree } from '@gaussian-splat/core';
import { type PackedGaussians } from './pack.js';
import { BAND_SIZES, FIRST_CODE_BYTE, SCALE_BIAS, SCALE_BYTES, SCALE_STEPS } from './sh.js';
import { GEOMETRY_WORDS, shWords } from './words.js';

/** Decodes the output of pack.ts and sh.ts with the stored precision. */

const bits = new Uint32Array(1);
const float = new Float32Array(bits.buffer);

/** Returns the float32 with these bits. */
function fromBits(word: number): number {
  bits[0] = word;
  return float[0];
}

/** Mask of the upper 22 bits of a float32. */
const HIGH_22 = 0xfffffc00;

/**
 * Writes the position, the factor (xx, yx, yy, zx, zy, zz) and the opacity of splat `i` to element `i` of three arrays.
 */
export function unpackSplat(
  geometry: Uint32Array,
  i: number,
  positions: Float32Array,
  factors: Float32Array,
  opacities: Float32Array,
): void {
  const at = GEOMETRY_WORDS * i;
  for (let axis = 0; axis < 3; axis++) positions[3 * i + axis] = fromBits(geometry[at + axis]);
  const first = geometry[at + 3];
  const second = geometry[at + 4];
  const third = geometry[at + 5];
  const fourth = geometry[at + 6];
  const fifth = geometry[at + 7];
  factors[6 * i] = fromBits(first & HIGH_22);
  factors[6 * i + 1] = fromBits(second & HIGH_22);
  factors[6 * i + 2] = fromBits(third & HIGH_22);
  factors[6 * i + 3] = fromBits(fourth & HIGH_22);
  factors[6 * i + 4] = fromBits(fifth & HIGH_22);
  factors[6 * i + 5] = fromBits((first << 22) | ((second & 0x3ff) << 12) | ((third & 0x300) << 2));
  opacities[i] = fromBits((third << 24) | ((fourth & 0x3ff) << 14) | ((fifth & 0x3ff) << 4));
}

let halves: Float32Array | undefined;

/** Returns the values of all 65,536 float16, indexed by their bits. */
function halfTable(): Float32Array {
  if (halves !== undefined) return halves;
  halves = new Float32Array(1 << 16);
  for (let half = 0; half < halves.length; half++) {
    const [exponent, mantissa] = [(half >>> 10) & 0x1f, half & 0x3ff];
    const magnitude = exponent === 0 ? mantissa * 2 ** -24 : (1 + mantissa / 1024) * 2 ** (exponent - 15);
    halves[half] = half & 0x8000 ? -magnitude : magnitude;
  }
  return halves;
}

/** Writes the harmonics of `count` splats, from index `first` on, to the beginning of `out`. */
export type ShReader = (first: number, count: number, out: Float32Array) => void;

/** Returns a function that reads the packed harmonics of a scene. */
export function shReader({
  sh,
  shDegree,
  shPrecision,
}: Pick<PackedGaussians, 'sh' | 'shDegree' | 'shPrecision'>): ShReader {
  return shPrecision === 'float16' ? halfReader(sh, shDegree) : int8Reader(sh, shDegree);
}

function halfReader(words: Uint32Array, degree: ShDegree): ShReader {
  const [table, numbers] = [halfTable(), 3 * shCoefficientCount(degree)];
  const source = new Uint16Array(words.buffer, words.byteOffset, 2 * words.length);
  const stride = 2 * shWords(degree, 'float16');
  return (first, count, out) => {
    for (let k = 0; k < count; k++) {
      const from = stride * (first + k);
      for (let n = 0; n < numbers; n++) out[numbers * k + n] = table[source[from + n]];
    }
  };
}

function int8Reader(words: Uint32Array, degree: ShDegree): ShReader {
  const [table, numbers] = [halfTable(), 3 * shCoefficientCount(degree)];
  const source = new Uint16Array(words.buffer, words.byteOffset, 2 * words.length);
  const codes = new Int8Array(words.buffer, words.byteOffset, 4 * words.length);
  const stride = 4 * shWords(degree, 'int8');
  return (first, count, out) => {
    for (let k = 0; k < count; k++) {
      const from = stride * (first + k);
      let to = numbers * k;
      for (let channel = 0; channel < 3; channel++) out[to++] = table[source[from / 2 + channel]];
      let code = from + FIRST_CODE_BYTE;
      for (let band = 0; band < degree; band++) {
        const scaleCode = codes[from + SCALE_BYTES[band]] & 0xff;
        const step = scaleCode === 0 ? 0 : 2 ** (scaleCode / SCALE_STEPS - SCALE_BIAS) / 127;
        for (let n = 0; n < 3 * BAND_SIZES[band]; n++, code++) {
          // The last code of degree 1 replaces the scale of band 2: see packSh.
          out[to++] = step * codes[code < from + stride ? code : from + SCALE_BYTES[1]];
        }
      }
    }
  };
}
