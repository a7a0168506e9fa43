import { constants, layouts } from '../generated/shaders.js';
import { FACTOR_NUMBERS, type SplatShapes } from '../levels/splat-level.js';

/**
 * Geometry of a chunk in half the bytes of `PackedGaussian`: 16 for each splat and 32 for each chunk. The layout is
 * that of shaders/shared/quantized_gaussian.wgsl.
 *
 * Steps of each property: centers 1/65,535 of the chunk's box; lengths of the rows of the covariance factor (standard
 * deviations along x, y and z) 1/1023 of the octaves between the smallest and the largest in the chunk. Directions of
 * the rows have errors of about 0.0004, opacities of 1/3000.
 */

const {
  CULL_GROUP,
  ALPHA_MIN,
  QUANTIZED_HEAD_ROWS,
  QUANTIZED_CHUNK_ROWS,
  QUANTIZED_SIZES,
  QUANTIZED_T_ZERO,
  QUANTIZED_UV_ZERO,
  QUANTIZED_OPAQUE,
} = constants;

/** Number of codes of a splat: see {@link putRow}. */
export const ROW_CODES = 10;
/** Number of 32-bit words of a chunk. */
export const QUANTIZED_CHUNK_WORDS = 4 * QUANTIZED_CHUNK_ROWS;
export const CENTER_STEPS = 65535;
/** Twice the maximum rounding error of a center, as a fraction of the diagonal of its chunk's box. */
export const CENTER_ROUNDING = 1 / CENTER_STEPS;
const MAX_OPACITY = 4095;
/** The lowest code of an opacity that is drawn. */
const FIRST_VISIBLE = Math.ceil(ALPHA_MIN * QUANTIZED_OPAQUE);
/**
 * Maximum number of octaves from the smallest to the largest row of a chunk. Anything smaller is invisible beside the
 * largest.
 */
export const MAX_OCTAVES = 24;

/** Factor of the reach of a chunk, which allows for the rounding of sizes, and of opacities that are barely visible. */
export const FARTHER = 1.02;
const REACH = layouts.Chunk.fields.reach.offset / 4;

const float = new Float32Array(1);
const bits = new Uint32Array(float.buffer);

/** Returns the smallest float32 that is at least the given non-negative number. */
function roundedUp(value: number): number {
  float[0] = value;
  if (float[0] < value) bits[0]++;
  return float[0];
}

/** Returns the nearest code of a value, 0 to `max`; 0 if `step` is 0. */
const codeOf = (value: number, min: number, step: number, max: number): number =>
  step > 0 ? Math.min(max, Math.max(0, Math.round((value - min) / step))) : 0;

/** Writes the lengths of the three rows of a covariance factor (xx, yx, yy, zx, zy, zz), from index `f` on. */
export function rowLengths(factors: Float32Array, f: number, lengths: Float64Array): void {
  lengths[0] = Math.abs(factors[f]);
  lengths[1] = Math.hypot(factors[f + 1], factors[f + 2]);
  lengths[2] = Math.hypot(factors[f + 3], factors[f + 4], factors[f + 5]);
}

/** Lengths of the rows of a chunk's splats: memory that all calls share. */
const chunkLengths = new Float64Array(3 * CULL_GROUP);

/**
 * Writes the lengths of the rows of some splats to {@link chunkLengths}. The sums of squares of float32 numbers are in
 * the range of float64. Returns log2 of the smallest and the largest; they differ by at most {@link MAX_OCTAVES}.
 */
function octavesOf({ factors }: SplatShapes, from: number, end: number): readonly [min: number, largest: number] {
  let [min, largest] = [Infinity, 0];
  for (let f = FACTOR_NUMBERS * from, at = 0; f < FACTOR_NUMBERS * end; f += FACTOR_NUMBERS, at += 3) {
    const x = Math.abs(factors[f]);
    const y = Math.sqrt(factors[f + 1] * factors[f + 1] + factors[f + 2] * factors[f + 2]);
    const [a, b, c] = [factors[f + 3], factors[f + 4], factors[f + 5]];
    const z = Math.sqrt(a * a + b * b + c * c);
    chunkLengths[at] = x;
    chunkLengths[at + 1] = y;
    chunkLengths[at + 2] = z;
    min = Math.min(min, x, y, z);
    largest = Math.max(largest, x, y, z);
  }
  const high = largest > 0 ? Math.log2(largest) : 0;
  return [Math.max(high - MAX_OCTAVES, Math.min(high, Math.log2(min))), high];
}

/**
 * Writes splats `from` to `end` of a level as one chunk, from word `at` on. The padding has opacity 0.
 * @param words Target array, which must be zero in the range of the chunk.
 */
export function packQuantizedChunk(
  level: SplatShapes,
  words: Uint32Array,
  at: number,
  from: number,
  end: number,
): void {
  if (end - from > CULL_GROUP) throw new RangeError(`expected at most ${CULL_GROUP} splats, found ${end - from}`);
  const head = new Float32Array(words.buffer, words.byteOffset + 4 * at, 8);
  const { positions, factors, opacities } = level;
  for (let axis = 0; axis < 3; axis++) {
    let [low, high] = [Infinity, -Infinity];
    for (let k = 3 * from + axis; k < 3 * end; k += 3) {
      if (positions[k] < low) low = positions[k];
      if (positions[k] > high) high = positions[k];
    }
    head[axis] = low;
    head[4 + axis] = roundedUp((high - low) / CENTER_STEPS);
  }
  const [min, largest] = octavesOf(level, from, end);
  head[3] = min;
  head[7] = roundedUp((largest - head[3]) / QUANTIZED_SIZES);
  const [x, y, z, size, stepX, stepY, stepZ, octaves] = head;
  let row = at + 4 * QUANTIZED_HEAD_ROWS;
  for (let i = from, k = 0; i < end; i++, k += 3, row += 4) {
    const f = FACTOR_NUMBERS * i;
    // The sign of a column does not change L Lᵀ, so the diagonal is made non-negative.
    const [first, second] = [factors[f] < 0 ? -1 : 1, factors[f + 2] < 0 ? -1 : 1];
    const t = directionIn2(first * factors[f + 1], factors[f + 2]);
    const [u, v] = directionIn3(first * factors[f + 3], second * factors[f + 4], factors[f + 5]);
    const centerX = codeOf(positions[3 * i], x, stepX, CENTER_STEPS);
    const centerY = codeOf(positions[3 * i + 1], y, stepY, CENTER_STEPS);
    const centerZ = codeOf(positions[3 * i + 2], z, stepZ, CENTER_STEPS);
    const size0 = codeOf(Math.log2(chunkLengths[k]), size, octaves, QUANTIZED_SIZES);
    const size1 = codeOf(Math.log2(chunkLengths[k + 1]), size, octaves, QUANTIZED_SIZES);
    const size2 = codeOf(Math.log2(chunkLengths[k + 2]), size, octaves, QUANTIZED_SIZES);
    words[row] = centerX | (centerY << 16);
    words[row + 1] = centerZ | (u << 16) | (t << 29);
    words[row + 2] = size0 | (size1 << 10) | (size2 << 20) | ((t >>> 3) << 30);
    words[row + 3] = v | (opacityCode(opacities[i]) << 13) | ((t >>> 5) << 25);
  }
}

/**
 * Writes the codes of a splat: x, y, z, three sizes, t, u, v, opacity.
 * @param row Index of the splat's first word.
 */
export function putRow(words: Uint32Array, row: number, codes: Int32Array): void {
  const t = codes[6];
  words[row] = codes[0] | (codes[1] << 16);
  words[row + 1] = codes[2] | (codes[7] << 16) | (t << 29);
  words[row + 2] = codes[3] | (codes[4] << 10) | (codes[5] << 20) | ((t >>> 3) << 30);
  words[row + 3] = codes[8] | (codes[9] << 13) | ((t >>> 5) << 25);
}

/** Reads the codes of a splat that {@link putRow} wrote. */
export function readRow(words: Uint32Array, row: number, codes: Int32Array): void {
  const [a, b, c, d] = [words[row], words[row + 1], words[row + 2], words[row + 3]];
  codes[0] = a & 0xffff;
  codes[1] = a >>> 16;
  codes[2] = b & 0xffff;
  codes[3] = c & 1023;
  codes[4] = (c >>> 10) & 1023;
  codes[5] = (c >>> 20) & 1023;
  codes[6] = (b >>> 29) | ((c >>> 30) << 3) | ((d >>> 25) << 5);
  codes[7] = (b >>> 16) & 0x1fff;
  codes[8] = d & 0x1fff;
  codes[9] = (d >>> 13) & 0xfff;
}

/**
 * Increases the reach of a chunk by the rounding of its quantized splats. @param at Index of the chunk's first number.
 */
export function widenReach(bounds: Float32Array, at: number): void {
  bounds[at + REACH] *= FARTHER;
}

/** Returns the code of an opacity. Rounding never crosses 1/255, because splats below it are not drawn. */
function opacityCode(opacity: number): number {
  const nearest = Math.min(MAX_OPACITY, Math.max(0, Math.round(opacity * QUANTIZED_OPAQUE)));
  return opacity >= ALPHA_MIN ? Math.max(nearest, FIRST_VISIBLE) : Math.min(nearest, FIRST_VISIBLE - 1);
}

/** Returns the code of the direction (x, |y|): its intersection with the line |x| + y = 1. */
export function directionIn2(x: number, y: number): number {
  const sum = Math.abs(x) + Math.abs(y);
  if (!(sum > 0)) return QUANTIZED_T_ZERO;
  return QUANTIZED_T_ZERO + Math.round((QUANTIZED_T_ZERO * x) / sum);
}

/**
 * Returns the codes of the direction (x, y, |z|). The octahedral map of the hemisphere is rotated by 45°, so that it
 * fills a square (Cigolle et al. 2014, "A Survey of Efficient Representations for Independent Unit Vectors").
 */
export function directionIn3(x: number, y: number, z: number): readonly [u: number, v: number] {
  const sum = Math.abs(x) + Math.abs(y) + Math.abs(z);
  if (!(sum > 0)) return [QUANTIZED_UV_ZERO, QUANTIZED_UV_ZERO];
  const coded = (value: number): number => QUANTIZED_UV_ZERO + Math.round((QUANTIZED_UV_ZERO * value) / sum);
  return [coded(x + y), coded(x - y)];
}
