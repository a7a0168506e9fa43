import {
  CHUNK_FLOATS,
  type ChunkErrors,
  CLASS_STEP,
  CLASSES,
  constants,
  directionIn2,
  directionIn3,
  ENDLESS,
  FACTOR_NUMBERS,
  FILE_FLOATS,
  interleaved,
  MIN_OPACITY_STEP,
  MIDDLE,
  type PageCoding,
  PLANES,
  rowLengths,
  SCALE_BIAS,
  SCALE_STEPS,
  shNumbers,
  type SplatLevel,
} from '@gaussian-splat/renderer/tools';
import { cutPages, type BuiltPage, type DetailTree } from './build-pages.js';
import { headOf, joined, Planes, type Deflate } from './page-planes.js';
import { differencesOf, HarmonicRounder } from './round-harmonics.js';
import type { SplatVisibility } from './splat-visibility.js';
import { numberOf, SplatWeights } from './splat-weights.js';

const { CULL_GROUP, ALPHA_MIN, QUANTIZED_OPAQUE, QUANTIZED_T_ZERO, QUANTIZED_UV_ZERO } = constants;
const MAX_PLACES = 65_535;
const MAX_SIZES = 255;
const MAX_COLOR = 32_000;
/** Rank of the splat size that determines the step of coordinates, as a fraction of a chunk's splats. */
const SIZE_RANK = 0.35;
/**
 * Binary logarithms of the factors of steps in levels above the finest. Such levels are far away, and the error of merging
 * is much larger than that of rounding.
 */
const COARSE: Octaves = { place: 4, size: 2, direction: 2, opacity: 2, color: 1, harmonics: 2 };
const FINEST: Octaves = { place: 0, size: 0, direction: 0, opacity: 0, color: 0, harmonics: 0 };

type Octaves = Readonly<Record<'place' | 'size' | 'direction' | 'opacity' | 'color' | 'harmonics', number>>;

/** Quantization steps of pages. */
export interface PageSteps {
  /** Step of coordinates, as a fraction of the splat size at `SIZE_RANK` of the chunk. */
  readonly place: number;
  /** Step of the binary logarithm of sizes. */
  readonly size: number;
  /** Step of the coordinates that represent directions. */
  readonly direction: number;
  readonly opacity: number;
  /** Step of the luma of the constant coefficient. */
  readonly color: number;
  /** Step of the color differences of the constant coefficient. */
  readonly chroma: number;
  /** Step of the coefficients above the constant one, for the most visible splats. */
  readonly harmonics: number;
}

/** Default steps, with which scenes have a PSNR of about 45 to 50 dB. */
export const DEFAULT_STEPS: PageSteps = {
  ...{ place: 0.15, size: 1 / 16, direction: 1 / 48, opacity: 1 / 90, color: 1 / 28, chroma: 1 / 14 },
  harmonics: 1 / 40,
};

/** Coding of pages, with the parameters that only a writer needs. */
export interface WrittenCoding extends PageCoding {
  /** See {@link PageSteps.place}. */
  readonly place: number;
}

/**
 * Returns the coding with the nearest steps that the files of a tree can represent.
 * @param tree Undefined for a scene in several trees, whose steps of sizes are at least the default ones.
 */
export function codingFor(steps: PageSteps, tree?: DetailTree): WrittenCoding {
  const odd = 2 * Math.round((1 / steps.direction - 1) / 2) + 1;
  const scale = Math.round(SCALE_STEPS * (Math.log2(127 * steps.harmonics) + SCALE_BIAS));
  return {
    size: Math.min(1, Math.max(1 / 48, tree ? minSizeStep(tree) : DEFAULT_STEPS.size, steps.size)),
    directions: Math.min(255, Math.max(3, odd)),
    opacity: Math.min(512, Math.max(MIN_OPACITY_STEP, Math.round(QUANTIZED_OPAQUE * steps.opacity))),
    color: steps.color,
    chroma: steps.chroma,
    scale: Math.min(255 - CLASS_STEP * (CLASSES - 1), Math.max(0, scale)),
    place: steps.place,
  };
}

/**
 * Smallest ratio of an extent of a splat to its largest one that pages must represent. A thinner splat may become this
 * thick.
 */
const MIN_RATIO = 2 ** -8;

const minSizeSteps = new WeakMap<DetailTree, number>();

/**
 * Returns the smallest step of the binary logarithm of sizes for which the codes of a page cover the sizes of all of its
 * splats: a smaller one would enlarge small splats. At most the default step, whose codes cover 16 octaves.
 */
function minSizeStep(tree: DetailTree): number {
  const known = minSizeSteps.get(tree);
  if (known !== undefined) return known;
  const ranges = tree.levels.map((level) =>
    Array.from({ length: Math.ceil(level.count / CULL_GROUP) }, (_, chunk) => {
      const first = CULL_GROUP * chunk;
      return sizeRange(level, first, Math.min(CULL_GROUP, level.count - first));
    }),
  );
  // A scene in several places has pages without the top.
  const pages = [true, false].flatMap((withTop) => cutPages(tree, withTop));
  const octaves = pages.map(({ holds }) => {
    const own = holds.map(([level, chunk]) => ranges[level][chunk]);
    const largest = own.reduce((max, range) => Math.max(max, range.largest), 0);
    const smallest = own.reduce((min, range) => Math.min(min, range.smallest), Infinity);
    return largest > 0 ? Math.log2(largest / smallest) : 0;
  });
  const step = Math.min(DEFAULT_STEPS.size, octaves.reduce((a, b) => Math.max(a, b), 0) / MAX_SIZES);
  minSizeSteps.set(tree, step);
  return step;
}

/** Options of {@link PageEncoder} besides a tree and its coding. */
export interface PageEncoderOptions {
  /** Compresses a section of a file. */
  readonly deflate: Deflate;
  /**
   * Visibility of the splats of the tree's cloud. Less visible splats have larger steps. By default, visibility is
   * estimated from opacities and sizes.
   */
  readonly seen?: SplatVisibility | undefined;
}

/** Encoder of the files of pages, which docs/lod-format.md describes. */
export class PageEncoder {
  readonly #tree: DetailTree;
  readonly #coding: WrittenCoding;
  readonly #deflate: Deflate;
  readonly #rounder: HarmonicRounder;
  readonly #weights: SplatWeights;

  /** @param coding Coding of all files of a folder. */
  constructor(tree: DetailTree, coding: WrittenCoding, { deflate, seen }: PageEncoderOptions) {
    const [leaves] = tree.levels;
    this.#tree = tree;
    this.#coding = coding;
    this.#deflate = deflate;
    this.#rounder = new HarmonicRounder(shNumbers(leaves.shDegree) / 3, seen);
    this.#weights = new SplatWeights(leaves, tree.reference, seen?.energies);
  }

  /** Returns the encoded file of a page. */
  encode({ holds, chunks }: BuiltPage): Uint8Array<ArrayBuffer> {
    const { levels, errors } = this.#tree;
    const { shDegree } = levels[0];
    const counts = holds.map(([level, chunk]) => Math.min(CULL_GROUP, levels[level].count - CULL_GROUP * chunk));
    const planes = new Planes(
      counts.reduce((sum, count) => sum + count, 0),
      shDegree,
    );
    const largest = holds.reduce(
      (max, [level, chunk], k) => Math.max(max, sizeRange(levels[level], CULL_GROUP * chunk, counts[k]).largest),
      0,
    );
    const min = Math.fround((largest > 0 ? Math.log2(largest) : 0) - MAX_SIZES * this.#coding.size);
    const floats = new Float32Array(CHUNK_FLOATS * chunks + FILE_FLOATS);
    holds.forEach(([level, chunk], k) => {
      if (k > 0 && level !== holds[k - 1][0]) planes.beginLower();
      const splats = this.#ordered(levels[level], CULL_GROUP * chunk, counts[k]);
      const reach = this.#putSplats(levels[level], splats, min, planes);
      floats.set([...splats.origin, splats.step, reach, ...rowOf(errors[level], chunk)], CHUNK_FLOATS * k);
    });
    const [level, chunk] = holds[0];
    const above = level + 1 < errors.length ? rowOf(errors[level + 1], chunk >> 2) : [0, 0, 0, 0, ENDLESS];
    floats.set([...above, min], CHUNK_FLOATS * chunks);
    return joined(headOf(counts, floats, { chunks, shDegree }), planes, this.#deflate);
  }

  #isFinest(level: SplatLevel): boolean {
    return level === this.#tree.levels[0] && !this.#tree.isMerged;
  }

  #octavesOf(level: SplatLevel): Octaves {
    return this.#isFinest(level) ? FINEST : COARSE;
  }

  /** Writes splats to planes. @returns Maximum reach of the splats in units of the scene, as in boundLevel. */
  #putSplats(level: SplatLevel, { splats }: Ordered, min: number, planes: Planes): number {
    const octaves = this.#octavesOf(level);
    let [fine, coarse, reach] = [0, 0, 0];
    for (const splat of splats) {
      let [low, high] = [splat.fine - fine, splat.coarse - coarse];
      if (low < 0) [low, high] = [low + 2 ** 24, high - 1];
      [fine, coarse] = [splat.fine, splat.coarse];
      for (let byte = 0; byte < 3; byte++) {
        planes.put(PLANES.place + byte, low >> (8 * byte));
        planes.put(PLANES.place + 3 + byte, high >> (8 * byte));
      }
      reach = Math.max(reach, putShape(level, splat.i, { min, octaves, coding: this.#coding }, planes));
      this.#putColors(level, splat.i, octaves, planes);
      planes.count++;
    }
    return reach;
  }

  #putColors(level: SplatLevel, i: number, octaves: Octaves, planes: Planes): void {
    const { sh, shDegree } = level;
    const first = shNumbers(shDegree) * numberOf(level, i);
    const shift = shDegree > 0 ? this.#putHarmonics(level, i, octaves, planes) : [0, 0, 0];
    const { color, chroma } = this.#coding;
    differencesOf(sh, first).forEach((value, n) => {
      const steps = roundedTo((value - shift[n]) / (n === 0 ? color : chroma), octaves.color);
      const code = MIDDLE + Math.max(-MAX_COLOR, Math.min(MAX_COLOR, steps));
      planes.put(PLANES.color + 2 * n, code);
      planes.put(PLANES.color + 2 * n + 1, code >> 8);
    });
  }

  /** Writes the coefficients above the constant one. @returns Number to subtract from the constant coefficient. */
  #putHarmonics(level: SplatLevel, i: number, octaves: Octaves, planes: Planes): readonly number[] {
    const rounder = this.#rounder;
    const number = numberOf(level, i);
    const first = shNumbers(level.shDegree) * number;
    const seenAs = this.#isFinest(level) ? number : undefined;
    let own = Math.round(1 + this.#weights.below(level, i) + octaves.harmonics);
    own = Math.min(CLASSES, Math.max(1, own));
    // A splat whose codes overflow a byte needs larger steps.
    while (!rounder.round(level.sh, first, seenAs, stepOf(this.#coding, own)) && own < CLASSES) own++;
    const isNone = rounder.codes.every((code) => code === 0);
    planes.put(PLANES.class, isNone ? 0 : own);
    if (!isNone) planes.putHarmonics(rounder.codes);
    return rounder.constantShift();
  }

  /** Returns the splats of a chunk along a Z-order curve, so that consecutive coordinates differ little. */
  #ordered(level: SplatLevel, first: number, count: number): Ordered {
    const own = level.positions.subarray(3 * first, 3 * (first + count));
    const origin = [0, 1, 2].map((axis) => extremeOf(own, axis, Math.min));
    const extent = Math.max(...origin.map((low, axis) => extremeOf(own, axis, Math.max) - low));
    const size = this.#coding.place * typicalSize(level, first, count) * 2 ** this.#octavesOf(level).place;
    const step = Math.fround(Math.max(size, (1.0001 * extent) / MAX_PLACES));
    const splats = Array.from({ length: count }, (_, k) => {
      const [x, y, z] = origin.map((low, axis) => (step > 0 ? Math.round((own[3 * k + axis] - low) / step) : 0));
      return { i: first + k, coarse: interleaved(x >> 8, y >> 8, z >> 8), fine: interleaved(x, y, z) };
    });
    // Scenes of planes keep the order of the file; see mortonOrder.
    if (!this.#tree.isOfPlanes) splats.sort((a, b) => a.coarse - b.coarse || a.fine - b.fine);
    return { origin, step, splats };
  }
}

interface Ordered {
  readonly origin: readonly number[];
  readonly step: number;
  /** For each splat, its index in the level, and the {@link interleaved} high and low bytes of its coordinates. */
  readonly splats: readonly { readonly i: number; readonly coarse: number; readonly fine: number }[];
}

function extremeOf(positions: Float32Array, axis: number, pick: (a: number, b: number) => number): number {
  let found = positions[axis];
  for (let k = axis + 3; k < positions.length; k += 3) found = pick(found, positions[k]);
  return found;
}

/** Returns the sphere (x, y, z, radius) and the error of a chunk. */
const rowOf = ({ spheres, errors }: ChunkErrors, chunk: number): number[] => [
  ...spheres.subarray(4 * chunk, 4 * chunk + 4),
  errors[chunk],
];

/** Returns the largest and the smallest extent of the splats of a chunk along an axis; see {@link MIN_RATIO}. */
function sizeRange({ factors }: SplatLevel, first: number, count: number): { largest: number; smallest: number } {
  const lengths = new Float64Array(3);
  let [largest, smallest] = [0, Infinity];
  for (let i = first; i < first + count; i++) {
    rowLengths(factors, FACTOR_NUMBERS * i, lengths);
    const own = Math.max(lengths[0], lengths[1], lengths[2]);
    largest = Math.max(largest, own);
    if (own > 0) smallest = Math.min(smallest, Math.max(Math.min(lengths[0], lengths[1], lengths[2]), MIN_RATIO * own));
  }
  return { largest, smallest };
}

/** Returns the smallest extent of the splat at the rank `SIZE_RANK` of a chunk. */
function typicalSize({ factors }: SplatLevel, first: number, count: number): number {
  const lengths = new Float64Array(3);
  const sizes = Float64Array.from({ length: count }, (_, k) => {
    rowLengths(factors, FACTOR_NUMBERS * (first + k), lengths);
    return Math.min(lengths[0], lengths[1], lengths[2]);
  }).sort();
  return sizes[Math.floor(SIZE_RANK * (sizes.length - 1))];
}

/** Writes size, directions and opacity of a splat. @returns Reach of the splat in units of the scene. */
function putShape(
  { factors, opacities }: SplatLevel,
  i: number,
  { min, octaves, coding }: { min: number; octaves: Octaves; coding: PageCoding },
  planes: Planes,
): number {
  const f = FACTOR_NUMBERS * i;
  const lengths = new Float64Array(3);
  rowLengths(factors, f, lengths);
  let trace = 0;
  lengths.forEach((length, k) => {
    const code = Math.min(MAX_SIZES, Math.max(0, roundedTo((Math.log2(length) - min) / coding.size, octaves.size)));
    planes.put(PLANES.size + k, code);
    trace += 2 ** (2 * (min + coding.size * code));
  });
  // The sign convention is that of packQuantizedChunk.
  const [first, second] = [factors[f] < 0 ? -1 : 1, factors[f + 2] < 0 ? -1 : 1];
  const t = directionIn2(first * factors[f + 1], factors[f + 2]);
  const [u, v] = directionIn3(first * factors[f + 3], second * factors[f + 4], factors[f + 5]);
  const last = coding.directions - 1;
  const zeros = [QUANTIZED_T_ZERO, QUANTIZED_UV_ZERO, QUANTIZED_UV_ZERO];
  // Numbers are rounded relative to the center of the range, so that 0, which means no rotation, has an exact code.
  [t, u, v].forEach((number, k) => {
    const code = last / 2 + roundedTo((number / zeros[k] - 1) * (last / 2), octaves.direction);
    planes.put(PLANES.direction + k, Math.min(last, Math.max(0, code)));
  });
  const opacity = Math.min(255, roundedTo((opacities[i] * QUANTIZED_OPAQUE) / coding.opacity, octaves.opacity));
  planes.put(PLANES.opacity, opacity);
  const shown = (opacity * coding.opacity) / QUANTIZED_OPAQUE;
  return 1.001 * Math.sqrt(trace * 2 * Math.log(Math.max(1, shown / ALPHA_MIN)));
}

const stepOf = ({ scale }: PageCoding, own: number): number =>
  2 ** ((scale + CLASS_STEP * (own - 1)) / SCALE_STEPS - SCALE_BIAS) / 127;

/** Rounds a number of steps to a multiple of 2^octaves. */
const roundedTo = (steps: number, octaves: number): number => 2 ** octaves * Math.round(steps / 2 ** octaves);
