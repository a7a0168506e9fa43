import { constants } from '../generated/shaders.js';
import { isOfPlanes } from '../pack/morton.js';
import { SCALE_BIAS, SCALE_STEPS } from '../pack/sh.js';
import type { BuiltPage, DetailTree } from './build-pages.js';
import { ENDLESS, type ChunkErrors } from './chunk-detail.js';
import {
  CHROMA_CODES,
  CHUNK_FLOATS,
  CLASS_STEP,
  CLASSES,
  DIFFERENCES,
  FILE_FLOATS,
  headBytes,
  interleaved,
  LEAST_OPACITY_STEP,
  PLAIN,
  PLANES,
  planesOf,
  type PageCoding,
} from './page-coding.js';
import { directionIn2, directionIn3, rowLengths } from './quantized-geometry.js';
import { FACTOR_NUMBERS, shNumbers, type SplatLevel } from './splat-level.js';

const { CULL_GROUP, ALPHA_MIN, QUANTIZED_OPAQUE, QUANTIZED_T_ZERO, QUANTIZED_UV_ZERO } = constants;
const MOST_PLACES = 65_535;
const MOST_SIZES = 255;
/** The splat of a chunk whose size coordinates are rounded by: so many of the chunk are smaller. */
const SIZE_RANK = 0.35;
/** The splat that the first class is of: so many weigh less. */
const REFERENCE_RANK = 0.9;
/** Coefficients above the constant one are taken for 0 below this share of a step: zeros cost hardly a bit. */
const DEAD_ZONE = 0.62;
/** Levels above the finest are so far from the scene that steps four times as large show nothing: octaves. */
const COARSE_OCTAVES = 2;
/** Of a luma and of each difference: their sum is a byte. */
const MOST_HARMONIC = 42;
/** Steps of what is rounded, in no unit that they share. */
export interface PageSteps {
  /** Of coordinates, in the least size of a splat of their chunk that many are smaller than. */
  readonly place: number;
  /** Octaves. */
  readonly size: number;
  /** Parts of the maps that directions are in. */
  readonly direction: number;
  readonly opacity: number;
  /** Of the constant coefficient, and of its differences of colours. */
  readonly color: number;
  readonly chroma: number;
  /** Of the other coefficients, in splats that show much. */
  readonly harmonics: number;
}

/** Of a scene that nothing is known of: some 45 to 50 dB. */
export const USUAL_STEPS: PageSteps = {
  ...{ place: 0.15, size: 1 / 16, direction: 1 / 48, opacity: 1 / 90, color: 1 / 28, chroma: 1 / 14 },
  harmonics: 1 / 40,
};

/** What compresses bytes to a piece of a raw deflate stream that others are put behind: it ends with a sync flush. */
export type Deflate = (bytes: Uint8Array) => Uint8Array;

/** What a writer has to know besides. */
export interface WrittenCoding extends PageCoding {
  /** Between two coordinates, as a part of how large splats of the chunk are. */
  readonly place: number;
}

/** The steps that files can have, and those next to the given ones. */
export function codingOf(steps: PageSteps): WrittenCoding {
  const odd = 2 * Math.round((1 / steps.direction - 1) / 2) + 1;
  const scale = Math.round(SCALE_STEPS * (Math.log2(127 * steps.harmonics) + SCALE_BIAS));
  return {
    size: Math.min(1, Math.max(1 / 48, steps.size)),
    directions: Math.min(255, Math.max(3, odd)),
    opacity: Math.min(512, Math.max(LEAST_OPACITY_STEP, Math.round(QUANTIZED_OPAQUE * steps.opacity))),
    color: steps.color,
    chroma: steps.chroma,
    scale: Math.min(255 - CLASS_STEP * (CLASSES - 1), Math.max(0, scale)),
    place: steps.place,
  };
}

/** What the planes of a file are made of: values in the order of its splats, chunk by chunk. */
class Planes {
  readonly bytes: Uint8Array[];
  count = 0;
  #classed = 0;

  constructor(splats: number, degree: SplatLevel['shDegree']) {
    this.bytes = Array.from({ length: planesOf(degree) }, () => new Uint8Array(splats));
  }

  put(plane: number, value: number): void {
    this.bytes[plane][this.count] = value & 255;
  }

  /** Coefficients above the constant one, of a class above 0. */
  putHarmonics(codes: Int8Array): void {
    codes.forEach((code, k) => (this.bytes[PLANES.harmonics + k][this.#classed] = code & 255));
    this.#classed++;
  }

  /** Those that have harmonics are fewer. */
  get whole(): Uint8Array[] {
    return this.bytes.map((plane, k) => (k < PLANES.harmonics ? plane : plane.subarray(0, this.#classed)));
  }
}

/** Writes coded files of pages: see docs/detail-pages.md. */
export class PageEncoder {
  readonly #tree: DetailTree;
  readonly #coding: WrittenCoding;
  readonly #deflate: Deflate;
  readonly #keepsOrder: boolean;
  /** See {@link classOf}. */
  readonly #reference: number;
  readonly #finest: SplatLevel;

  /** @param coding of all files of the folder */
  constructor(tree: DetailTree, coding: WrittenCoding, deflate: Deflate) {
    this.#tree = tree;
    this.#coding = coding;
    this.#deflate = deflate;
    // Splats of planes stay in the file's order: see mortonOrder.
    this.#keepsOrder = isOfPlanes(tree.levels[0].positions);
    const [leaves] = tree.levels;
    const weights = Float64Array.from({ length: leaves.count }, (_, i) => weightOf(leaves, i)).sort();
    this.#reference = weights[Math.floor(REFERENCE_RANK * (weights.length - 1))];
    this.#finest = leaves;
  }

  /** The file of a page. */
  encode({ holds, chunks }: BuiltPage): Uint8Array<ArrayBuffer> {
    const { levels, errors } = this.#tree;
    const { shDegree } = levels[0];
    const counts = holds.map(([level, chunk]) => Math.min(CULL_GROUP, levels[level].count - CULL_GROUP * chunk));
    const planes = new Planes(
      counts.reduce((sum, count) => sum + count, 0),
      shDegree,
    );
    const largest = holds.reduce(
      (most, [level, chunk], k) => Math.max(most, largestOf(levels[level], CULL_GROUP * chunk, counts[k])),
      0,
    );
    const least = Math.fround((largest > 0 ? Math.log2(largest) : 0) - MOST_SIZES * this.#coding.size);
    const floats = new Float32Array(CHUNK_FLOATS * chunks + FILE_FLOATS);
    holds.forEach(([level, chunk], k) => {
      const splats = this.#ordered(levels[level], CULL_GROUP * chunk, counts[k]);
      const reference = this.#reference + this.#octavesOf(levels[level]);
      const reach = putSplats(levels[level], splats, least, this.#coding, reference, planes);
      floats.set([...splats.origin, splats.step, reach, ...rowOf(errors[level], chunk)], CHUNK_FLOATS * k);
    });
    const [level, chunk] = holds[0];
    const above = level + 1 < errors.length ? rowOf(errors[level + 1], chunk >> 2) : [0, 0, 0, 0, ENDLESS];
    floats.set([...above, least], CHUNK_FLOATS * chunks);
    return joined(headOf(counts, floats, { chunks, shDegree }), planes, this.#deflate);
  }

  /** How much coarser than those of the finest level steps are. */
  #octavesOf(level: SplatLevel): number {
    return level === this.#finest ? 0 : COARSE_OCTAVES;
  }

  /** Splats of a chunk along a curve through it, on which coordinates differ little from one to the next. */
  #ordered(level: SplatLevel, first: number, count: number): Ordered {
    const own = level.positions.subarray(3 * first, 3 * (first + count));
    const origin = [0, 1, 2].map((axis) => extremeOf(own, axis, Math.min));
    const extent = Math.max(...origin.map((low, axis) => extremeOf(own, axis, Math.max) - low));
    const size = this.#coding.place * typicalSize(level, first, count) * 2 ** this.#octavesOf(level);
    const step = Math.fround(Math.max(size, (1.0001 * extent) / MOST_PLACES));
    const splats = Array.from({ length: count }, (_, k) => {
      const [x, y, z] = origin.map((low, axis) => (step > 0 ? Math.round((own[3 * k + axis] - low) / step) : 0));
      return { i: first + k, coarse: interleaved(x >> 8, y >> 8, z >> 8), fine: interleaved(x, y, z) };
    });
    if (!this.#keepsOrder) splats.sort((a, b) => a.coarse - b.coarse || a.fine - b.fine);
    return { origin, step, splats };
  }
}

interface Ordered {
  readonly origin: readonly number[];
  readonly step: number;
  /** Number in the level, and the upper and the lower bytes of the coordinates, {@link interleaved}. */
  readonly splats: readonly { readonly i: number; readonly coarse: number; readonly fine: number }[];
}

function extremeOf(positions: Float32Array, axis: number, pick: (a: number, b: number) => number): number {
  let found = positions[axis];
  for (let k = axis + 3; k < positions.length; k += 3) found = pick(found, positions[k]);
  return found;
}

/** Sphere and error of a chunk. */
const rowOf = ({ spheres, errors }: ChunkErrors, chunk: number): number[] => [
  ...spheres.subarray(4 * chunk, 4 * chunk + 4),
  errors[chunk],
];

function largestOf({ factors }: SplatLevel, first: number, count: number): number {
  const lengths = new Float64Array(3);
  let largest = 0;
  for (let i = first; i < first + count; i++) {
    rowLengths(factors, FACTOR_NUMBERS * i, lengths);
    largest = Math.max(largest, lengths[0], lengths[1], lengths[2]);
  }
  return largest;
}

/** Log2 of how much an error of a splat's colour adds to that of pictures: its opacity, and the root of the area that it covers. */
function weightOf({ factors, opacities }: SplatLevel, i: number): number {
  const lengths = new Float64Array(3);
  rowLengths(factors, FACTOR_NUMBERS * i, lengths);
  lengths.sort();
  return Math.max(-60, Math.log2(opacities[i]) + Math.log2(lengths[1] * lengths[2]) / 2);
}

/** Splats that weigh less have larger steps: as much larger as lets a bit save the same everywhere. */
function classOf(level: SplatLevel, i: number, reference: number): number {
  if (level.shDegree === 0) return 0;
  return 1 + Math.min(CLASSES - 1, Math.max(0, Math.round(reference - weightOf(level, i))));
}

/** Puts splats into planes. @returns how far they reach, as boundLevel finds it */
function putSplats(
  level: SplatLevel,
  { splats }: Ordered,
  least: number,
  coding: PageCoding,
  reference: number,
  planes: Planes,
): number {
  let [fine, coarse, reach] = [0, 0, 0];
  for (const splat of splats) {
    let [low, high] = [splat.fine - fine, splat.coarse - coarse];
    if (low < 0) [low, high] = [low + 2 ** 24, high - 1];
    [fine, coarse] = [splat.fine, splat.coarse];
    for (let byte = 0; byte < 3; byte++) {
      planes.put(PLANES.place + byte, low >> (8 * byte));
      planes.put(PLANES.place + 3 + byte, high >> (8 * byte));
    }
    reach = Math.max(reach, putShape(level, splat.i, least, coding, planes));
    putColors(level, splat.i, coding, classOf(level, splat.i, reference), planes);
    planes.count++;
  }
  return reach;
}

/** Of the least extents of splats, the one that {@link SIZE_RANK} of them are below. */
function typicalSize({ factors }: SplatLevel, first: number, count: number): number {
  const lengths = new Float64Array(3);
  const sizes = Float64Array.from({ length: count }, (_, k) => {
    rowLengths(factors, FACTOR_NUMBERS * (first + k), lengths);
    return Math.min(lengths[0], lengths[1], lengths[2]);
  }).sort();
  return sizes[Math.floor(SIZE_RANK * (sizes.length - 1))];
}

/** @returns how far the splat reaches */
function putShape(
  { factors, opacities }: SplatLevel,
  i: number,
  least: number,
  coding: PageCoding,
  planes: Planes,
): number {
  const f = FACTOR_NUMBERS * i;
  const lengths = new Float64Array(3);
  rowLengths(factors, f, lengths);
  let trace = 0;
  lengths.forEach((length, k) => {
    const code = Math.min(MOST_SIZES, Math.max(0, Math.round((Math.log2(length) - least) / coding.size)));
    planes.put(PLANES.size + k, code);
    trace += 2 ** (2 * (least + coding.size * code));
  });
  // As packQuantizedChunk turns columns.
  const [first, second] = [factors[f] < 0 ? -1 : 1, factors[f + 2] < 0 ? -1 : 1];
  const t = directionIn2(first * factors[f + 1], factors[f + 2]);
  const [u, v] = directionIn3(first * factors[f + 3], second * factors[f + 4], factors[f + 5]);
  const last = coding.directions - 1;
  planes.put(PLANES.direction, Math.round((t * last) / (2 * QUANTIZED_T_ZERO)));
  planes.put(PLANES.direction + 1, Math.round((u * last) / (2 * QUANTIZED_UV_ZERO)));
  planes.put(PLANES.direction + 2, Math.round((v * last) / (2 * QUANTIZED_UV_ZERO)));
  const opacity = Math.min(255, Math.round((opacities[i] * QUANTIZED_OPAQUE) / coding.opacity));
  planes.put(PLANES.opacity, opacity);
  const shown = (opacity * coding.opacity) / QUANTIZED_OPAQUE;
  return 1.001 * Math.sqrt(trace * 2 * Math.log(Math.max(1, shown / ALPHA_MIN)));
}

function putColors(
  { sh, shOrder, shDegree }: SplatLevel,
  i: number,
  coding: PageCoding,
  finest: number,
  planes: Planes,
): void {
  const stride = shNumbers(shDegree);
  const first = stride * (shOrder ? shOrder[i] : i);
  const [luma, orange, green] = differencesOf(sh, first);
  [luma / coding.color, orange / coding.chroma, green / coding.chroma].forEach((value, n) => {
    const code = Math.max(-32768, Math.min(32767, Math.round(value)));
    planes.put(PLANES.color + 2 * n, code);
    planes.put(PLANES.color + 2 * n + 1, code >> 8);
  });
  if (shDegree === 0) return;
  const codes = new Int8Array(stride - 3);
  let own = finest;
  // One that does not fit into a byte needs larger steps.
  while (!fillHarmonics(sh, first + 3, stepOf(coding, own), codes) && own < CLASSES) own++;
  const isNone = codes.every((code) => code === 0);
  planes.put(PLANES.class, isNone ? 0 : own);
  if (!isNone) planes.putHarmonics(codes);
}

const stepOf = ({ scale }: PageCoding, own: number): number =>
  2 ** ((scale + CLASS_STEP * (own - 1)) / SCALE_STEPS - SCALE_BIAS) / 127;

/** A colour's luma and its differences of colours, red less blue and green less their mean: of most colours these are small. */
function differencesOf(sh: Float32Array, at: number): [luma: number, orange: number, green: number] {
  const middle = (sh[at] + sh[at + 2]) / 2;
  return [(middle + sh[at + 1]) / 2, sh[at] - sh[at + 2], sh[at + 1] - middle];
}

/** @returns false if some had to be cut */
function fillHarmonics(sh: Float32Array, at: number, step: number, codes: Int8Array): boolean {
  let isWhole = true;
  for (let k = 0; k < codes.length; k += 3) {
    differencesOf(sh, at + k).forEach((value, n) => {
      const size = Math.abs(value) / (n === 0 ? step : CHROMA_CODES * step);
      const code = size < DEAD_ZONE ? 0 : Math.round(size);
      // Half of this range is what the sum of a luma and differences has room for.
      if (code > MOST_HARMONIC) isWhole = false;
      codes[k + n] = Math.sign(value) * Math.min(MOST_HARMONIC, code);
    });
  }
  return isWhole;
}

/** The bytes before the planes; how these are told is not known yet. */
function headOf(counts: readonly number[], floats: Float32Array, file: Parameters<typeof headBytes>[0]): Uint8Array {
  const head = new Uint8Array(headBytes(file));
  head.set(counts.map((count) => count - 1));
  const words = new Uint32Array(floats.buffer);
  words.forEach((word, k) => {
    for (let byte = 0; byte < 4; byte++) head[counts.length + byte * words.length + k] = word >>> (8 * byte);
  });
  return head;
}

/** An empty last block of a deflate stream. */
const END = Uint8Array.of(3, 0);

function joined(head: Uint8Array, { whole: bytes }: Planes, deflate: Deflate): Uint8Array<ArrayBuffer> {
  const pieces = bytes.map((plane, k) => {
    const differences = plane.map((byte, i) => byte - (i > 0 ? plane[i - 1] : 0));
    const [plain, changed] = [plane, differences].map(deflate);
    const mode = changed.length < plain.length ? DIFFERENCES : PLAIN;
    head[head.length - bytes.length + k] = mode;
    return mode === PLAIN ? plain : changed;
  });
  const all = [deflate(head), ...pieces, END];
  const file = new Uint8Array(all.reduce((sum, { length }) => sum + length, 0));
  let at = 0;
  for (const piece of all) {
    file.set(piece, at);
    at += piece.length;
  }
  return file;
}
