import { constants, layouts } from '../generated/shaders.js';
import { FACTOR_NUMBERS, type SplatLevel } from './splat-level.js';
import { boundRuns } from '../pack/chunks.js';
import { CHUNK_NUMBERS } from '../pack/words.js';

/** Number of 32-bit words in one `ChunkDetail` of the shaders. */
export const DETAIL_NUMBERS = layouts.ChunkDetail.size / 4;

const { CULL_GROUP, ALPHA_MIN, NO_CHILDREN } = constants;
const fields = layouts.ChunkDetail.fields;
const place = (name: keyof typeof fields): number => fields[name].offset / 4;

/** Index of each field in a row. */
export const DETAIL_PLACES = {
  sphere: place('sphere'),
  parentSphere: place('parent_sphere'),
  error: place('error'),
  parentError: place('parent_error'),
  fullError: place('full_error'),
  children: place('children'),
} as const;

/** Parent error of a chunk without a parent: larger than any threshold. */
export const ENDLESS = 1e25;

/**
 * Factor of the error and the sphere of a parent. It exceeds the rounding error of float32, so that both are strictly
 * larger than those of the children.
 */
const STRICTLY = 1.00001;

/** Sphere and error of each of the C chunks in a level. */
export interface ChunkErrors {
  readonly count: number;
  /**
   * [C, 4] center and radius in world units: encloses the centers of the splats and the spheres of the child chunks.
   */
  readonly spheres: Float32Array;
  /** [C] errors in world units: 0 for the finest level, otherwise larger than those of the child chunks. */
  readonly errors: Float32Array;
}

/** `Chunk` rows of merged splats: boxes of their centers, and their reach. */
export const boundLevel = ({ count, positions, factors, opacities }: SplatLevel): Float32Array =>
  boundRuns(count, positions, (i) =>
    Math.sqrt(traceOf(factors, i) * 2 * Math.log(Math.max(1, opacities[i] / ALPHA_MIN))),
  );

/** Returns the trace of a splat's covariance, which is at least the variance along its longest axis. */
function traceOf(factors: Float32Array, i: number): number {
  let sum = 0;
  for (let k = 0; k < FACTOR_NUMBERS; k++) sum += factors[FACTOR_NUMBERS * i + k] ** 2;
  return sum;
}

/** Returns the errors of the finest level, which are 0. Its spheres enclose the boxes of the chunks. */
export function leafErrors(chunks: Float32Array): ChunkErrors {
  const count = chunks.length / CHUNK_NUMBERS;
  const spheres = new Float32Array(4 * count);
  for (let c = 0; c < count; c++) spheres.set(sphereOfBox(chunks, c), 4 * c);
  return { count, spheres, errors: new Float32Array(count) };
}

/**
 * Returns the errors of a coarser level, whose chunk c represents chunks 4 c to 4 c + 3 of `finer`.
 * @param rounding Twice the maximum rounding error of centers, as a fraction of the diagonal of a chunk's box.
 */
export function parentErrors(level: SplatLevel, chunks: Float32Array, finer: ChunkErrors, rounding = 0): ChunkErrors {
  const count = chunks.length / CHUNK_NUMBERS;
  const spheres = new Float32Array(4 * count);
  const errors = new Float32Array(count);
  for (let c = 0; c < count; c++) {
    const [x, y, z, own] = sphereOfBox(chunks, c);
    let [radius, error] = [own, Math.hypot(ownError(level, c), rounding * 2 * own)];
    for (let child = 4 * c; child < Math.min(4 * c + 4, finer.count); child++) {
      const [cx, cy, cz, r] = finer.spheres.subarray(4 * child, 4 * child + 4);
      radius = Math.max(radius, Math.hypot(x - cx, y - cy, z - cz) + r);
      error = Math.max(error, finer.errors[child]);
    }
    // Adds the float32 rounding of the center itself, which matters far from the origin.
    const rounded = 1e-6 * Math.hypot(x, y, z);
    spheres.set([x, y, z, radius * STRICTLY + rounded], 4 * c);
    errors[c] = Math.max(error * STRICTLY, MIN_ERROR);
  }
  return { count, spheres, errors };
}

/** Minimum error of a merge, even without displacement, so that a threshold of 0 draws the leaves. */
const MIN_ERROR = 1e-20;

/**
 * Returns twice the root mean square displacement of the splats that were merged in a chunk, in world units. Nearly all
 * splats are displaced less.
 */
function ownError({ count, spreads }: SplatLevel, chunk: number): number {
  const [first, end] = [CULL_GROUP * chunk, Math.min(count, CULL_GROUP * (chunk + 1))];
  let [sum, merged] = [0, 0];
  for (let i = first; i < end; i++) {
    sum += spreads[i];
    if (spreads[i] > 0) merged++;
  }
  return 2 * Math.sqrt(sum / Math.max(1, merged));
}

function sphereOfBox(chunks: Float32Array, c: number): [number, number, number, number] {
  const at = CHUNK_NUMBERS * c;
  const [x, y, z] = [0, 1, 2].map((axis) => Math.fround((chunks[at + axis] + chunks[at + 4 + axis]) / 2));
  const radius = Math.hypot(...[0, 1, 2].map((axis) => (chunks[at + 4 + axis] - chunks[at + axis]) / 2));
  return [x, y, z, radius * STRICTLY];
}

/**
 * Returns [C, DETAIL_NUMBERS] rows of one level.
 * @param parents Errors of the next coarser level; undefined for the coarsest.
 */
export function detailRows(own: ChunkErrors, parents: ChunkErrors | undefined): Float32Array {
  const rows = new Float32Array(DETAIL_NUMBERS * own.count);
  const words = new Uint32Array(rows.buffer);
  for (let c = 0; c < own.count; c++) {
    const at = DETAIL_NUMBERS * c;
    rows.set(own.spheres.subarray(4 * c, 4 * c + 4), at + DETAIL_PLACES.sphere);
    rows[at + DETAIL_PLACES.error] = own.errors[c];
    rows[at + DETAIL_PLACES.fullError] = own.errors[c];
    rows[at + DETAIL_PLACES.parentError] = parents?.errors[c >> 2] ?? ENDLESS;
    if (parents) rows.set(parents.spheres.subarray(4 * (c >> 2), 4 * (c >> 2) + 4), at + DETAIL_PLACES.parentSphere);
    words[at + DETAIL_PLACES.children] = NO_CHILDREN;
  }
  return rows;
}
