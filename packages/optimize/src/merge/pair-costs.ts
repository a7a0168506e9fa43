import { shCoefficientCount, type Camera, type GaussianCloud } from '@gaussian-splat/core';
import { splatRows, scaleRotationFactor } from '@gaussian-splat/renderer/stages';
import { DILATION } from './project.js';
import { AMPLITUDE, SEEN, seenSplats, U, UU, UV, V, VV } from './splat-visibility.js';

const root = new Float64Array(6);

/**
 * Writes the center and the covariance of splat `i` to its row.
 * @param rows [N, ROW] rows in the layout of splat-rows.ts of the renderer.
 */
export function writeRow(cloud: GaussianCloud, i: number, rows: Float64Array): void {
  const p = splatRows.ROW * i;
  scaleRotationFactor(cloud, i, root);
  splatRows.covarianceOf(root, 0, rows, p);
  rows[p + splatRows.X] = cloud.positions[3 * i];
  rows[p + splatRows.Y] = cloud.positions[3 * i + 1];
  rows[p + splatRows.Z] = cloud.positions[3 * i + 2];
}

const { joinMoments, MASS, ROW, X, Y, Z } = splatRows;
/** Mean squared difference of a splat's color from the colors behind it in captured scenes, for each channel. */
const CONTRAST = 0.05;
/** Minimum number of views that must show both splats of a pair. */
const MIN_VIEWS = 4;
/** Area of the unit sphere. Because ∫ Y² = 1, a squared coefficient divided by it is a mean square over directions. */
const SPHERE = 4 * Math.PI;

/** State of splats that may be merged, in arrays that threads can access. */
export interface PairState {
  /** [N, ROW] centers, covariances and weights: splat-rows.ts of the renderer. */
  readonly rows: Float64Array;
  /** [N, views, SEEN] projections: splat-visibility.ts. */
  readonly seen: Float32Array;
  /** [N] fraction of each splat's opacity that is visible in the view that shows it best, 0..1. */
  readonly visible: Float32Array;
  /** [N, numbers] coefficients of spherical harmonics. */
  readonly sh: Float32Array;
  /** Count of coefficients of a splat, over all channels. */
  readonly numbers: number;
  readonly views: number;
  /** Mean number of pixels of the views. */
  readonly pixels: number;
  readonly antialiased: boolean;
  readonly filterVariance: number;
}

/**
 * Computes the state of all splats of a cloud.
 * @param contribution [N] as {@link Ranking.contribution}.
 * @param views Views from all sides, because a pair may resemble one splat from one side only.
 * @param allocate Allocates the arrays: 0.4 kB for each splat plus its harmonics.
 */
export function pairState(
  cloud: GaussianCloud,
  contribution: Float32Array,
  views: readonly Camera[],
  allocate: (byteLength: number) => ArrayBufferLike,
): PairState {
  const { count, antialiased, filterVariance = DILATION } = cloud;
  const floats = (length: number): Float32Array => new Float32Array(allocate(4 * length), 0, length);
  const state = {
    rows: new Float64Array(allocate(8 * ROW * count), 0, ROW * count),
    seen: seenSplats(cloud, views, floats(SEEN * views.length * count)),
    visible: floats(count),
    sh: floats(cloud.sh.length),
    numbers: 3 * shCoefficientCount(cloud.shDegree),
    views: views.length,
    pixels: views.reduce((sum, { width, height }) => sum + width * height, 0) / views.length,
    antialiased,
    filterVariance,
  };
  state.sh.set(cloud.sh);
  for (let i = 0; i < count; i++) {
    writeRow(cloud, i, state.rows);
    weigh(state, i, contribution[i]);
  }
  return state;
}

/**
 * Estimates the errors of merging splats, and merges them. A merged splat has the mean, the covariance and the color of
 * both splats together, weighted by their visibility. Its opacity covers the same area in the views. Splats are
 * identified by slots; a slot has a splat of the cloud, or a merged splat.
 */
export class PairCosts {
  /** Weight of the first splat of the last evaluated pair, 0..1. */
  share = 1;
  /** Opacity of the merged splat of the last evaluated pair, 0..1. */
  opacity = 0;
  readonly #state: PairState;
  readonly #rows: Float64Array;
  readonly #views: number;
  readonly #seen: Float32Array;
  readonly #visible: Float32Array;
  readonly #sh: Float32Array;
  readonly #numbers: number;
  readonly #antialiased: boolean;
  readonly #variance: number;

  constructor(state: PairState) {
    this.#state = state;
    ({ rows: this.#rows, views: this.#views, seen: this.#seen, visible: this.#visible } = state);
    ({ sh: this.#sh, numbers: this.#numbers, antialiased: this.#antialiased, filterVariance: this.#variance } = state);
  }

  /** Writes the positions of all splats to `found`, [N, 3], and returns it. */
  positions(found: Float32Array): Float32Array {
    const count = this.#rows.length / ROW;
    for (let i = 0; i < count; i++) for (const axis of [X, Y, Z]) found[3 * i + axis] = this.#rows[ROW * i + axis];
    return found;
  }

  /**
   * Returns the mean squared error of a view's image, peak 1, from merging two splats. Infinity if they cannot be merged.
   * With weights w in a view, both splats differ from the merged splat by w₁G₁ + w₂G₂ − wG against the background, and by
   * the differences of their colors from the mean color. Products of Gaussians have closed-form integrals: ∫ G₁ G₂ = 2π
   * √|Σ₁| √|Σ₂| / √|Σ₁ + Σ₂| · exp(−δᵀ (Σ₁ + Σ₂)⁻¹ δ / 2).
   * @param i Slot of the first splat.
   * @param j Slot of the second splat.
   * @param step Only every `step`-th view is evaluated.
   */
  cost(i: number, j: number, step = 1): number {
    const rows = this.#rows;
    const seen = this.#seen;
    const p = rows[ROW * i + MASS] / (rows[ROW * i + MASS] + rows[ROW * j + MASS]);
    const q = 1 - p;
    if (!(p >= 0)) return Infinity;
    const [seeI, seeJ] = [this.#visible[i], this.#visible[j]];
    const visible = p * seeI + q * seeJ;
    // Sums over views, with areas in units of 2π: products of both coverages with that of the merged splat, squares of
    // the latter, and squares and products of weights.
    let [covered, ownSquare, squares, products, own, apart, views] = [0, 0, 0, 0, 0, 0, 0];
    const stride = SEEN * step;
    let b = SEEN * this.#views * j;
    for (let a = SEEN * this.#views * i, end = a + SEEN * this.#views; a < end; a += stride, b += stride) {
      if (seen[a + AMPLITUDE] === 0 || seen[b + AMPLITUDE] === 0) continue;
      views++;
      const [du, dv] = [seen[b + U] - seen[a + U], seen[b + V] - seen[a + V]];
      const [uuA, uvA, vvA] = [seen[a + UU], seen[a + UV], seen[a + VV]];
      const [uuB, uvB, vvB] = [seen[b + UU], seen[b + UV], seen[b + VV]];
      const uu = p * uuA + q * uuB + p * q * du * du;
      const uv = p * uvA + q * uvB + p * q * du * dv;
      const vv = p * vvA + q * vvB + p * q * dv * dv;
      const areaA = Math.sqrt(uuA * vvA - uvA * uvA);
      const areaB = Math.sqrt(uuB * vvB - uvB * uvB);
      const area = Math.sqrt(uu * vv - uv * uv);
      const amplitude = visible * (this.#antialiased ? compensation(uu, uv, vv, this.#variance) : 1);
      const both = areaA * areaB * overlap(uuA + uuB, uvA + uvB, vvA + vvB, du, dv);
      const withA = areaA * area * overlap(uuA + uu, uvA + uv, vvA + vv, q * du, q * dv);
      const withB = areaB * area * overlap(uuB + uu, uvB + uv, vvB + vv, p * du, p * dv);
      let weightA = seeI * seen[a + AMPLITUDE];
      let weightB = seeJ * seen[b + AMPLITUDE];
      const alone = weightA * areaA + weightB * areaB;
      const cover = alone - Math.max(seeI, seeJ) * seen[a + AMPLITUDE] * seen[b + AMPLITUDE] * both;
      weightA *= cover / alone;
      weightB *= cover / alone;
      covered += cover * amplitude * area;
      ownSquare += (amplitude * area) ** 2;
      squares += (weightA * weightA * areaA + weightB * weightB * areaB) / 2 + 2 * weightA * weightB * both;
      products += amplitude * (weightA * withA + weightB * withB);
      own += (amplitude * amplitude * area) / 2;
      const [offA, offB] = [weightA * q, weightB * p];
      apart += (offA * offA * areaA + offB * offB * areaB) / 2 - 2 * offA * offB * both;
    }
    if (views * step < MIN_VIEWS) return Infinity;
    const opacity = covered / ownSquare;
    this.share = p;
    this.opacity = opacity;
    if (!(opacity <= 1)) return Infinity;
    const shape = Math.max(0, squares - 2 * opacity * products + opacity * opacity * own);
    const square = this.#colorDifference(i, j) * Math.max(0, apart) + CONTRAST * shape;
    return (2 * Math.PI * square) / (views * this.#state.pixels);
  }

  /** Merges the last evaluated pair, slots `i` and `j`, into slot `i`. */
  join(i: number, j: number): void {
    const { share: p, opacity } = this;
    const rows = this.#rows;
    const q = 1 - p;
    const seen = this.#seen;
    joinMoments(rows, ROW * i, ROW * j, p);
    rows[ROW * i + MASS] += rows[ROW * j + MASS];
    this.#visible[i] = p * this.#visible[i] + q * this.#visible[j];
    for (let k = 0; k < this.#numbers; k++) {
      const at = this.#numbers * i + k;
      this.#sh[at] = p * this.#sh[at] + q * this.#sh[this.#numbers * j + k];
    }
    for (let view = 0; view < this.#views; view++) {
      const [a, b] = [SEEN * (this.#views * i + view), SEEN * (this.#views * j + view)];
      const isSeen = seen[a + AMPLITUDE] > 0 && seen[b + AMPLITUDE] > 0;
      const [du, dv] = [seen[b + U] - seen[a + U], seen[b + V] - seen[a + V]];
      seen[a + U] += q * du;
      seen[a + V] += q * dv;
      seen[a + UU] = p * seen[a + UU] + q * seen[b + UU] + p * q * du * du;
      seen[a + UV] = p * seen[a + UV] + q * seen[b + UV] + p * q * du * dv;
      seen[a + VV] = p * seen[a + VV] + q * seen[b + VV] + p * q * dv * dv;
      const compensated = this.#antialiased
        ? compensation(seen[a + UU], seen[a + UV], seen[a + VV], this.#variance)
        : 1;
      seen[a + AMPLITUDE] = isSeen ? opacity * compensated : 0;
    }
  }

  /** Returns the mean squared difference of the colors of two splats, over all directions and channels. */
  #colorDifference(i: number, j: number): number {
    let sum = 0;
    for (let k = 0, a = this.#numbers * i, b = this.#numbers * j; k < this.#numbers; k++) {
      const difference = this.#sh[a + k] - this.#sh[b + k];
      sum += difference * difference;
    }
    return sum / (3 * SPHERE);
  }
}

/** Sets `visible` and the weight (mass) of splat `i`, which is its visible area summed over all views. */
function weigh({ rows, seen, visible, views }: PairState, i: number, contribution: number): void {
  let [max, cover] = [0, 0];
  for (let view = 0; view < views; view++) {
    const at = SEEN * (views * i + view);
    const amplitude = seen[at + AMPLITUDE];
    if (amplitude === 0) continue;
    max = Math.max(max, amplitude);
    cover += amplitude * Math.sqrt(seen[at + UU] * seen[at + VV] - seen[at + UV] ** 2);
  }
  visible[i] = max > 0 ? Math.min(1, contribution / max) : 0;
  rows[ROW * i + MASS] = visible[i] * cover;
}

/**
 * Returns ∫ G₁ G₂ divided by 2π √|Σ₁| √|Σ₂|, from the sum of the covariances (uu, uv, vv) and the difference of the
 * centers (du, dv).
 */
function overlap(uu: number, uv: number, vv: number, du: number, dv: number): number {
  const determinant = uu * vv - uv * uv;
  return Math.exp((-0.5 * (vv * du * du - 2 * uv * du * dv + uu * dv * dv)) / determinant) / Math.sqrt(determinant);
}

/** Returns the factor of a splat's opacity that compensates for the filter variance in its covariance, 0..1. */
function compensation(uu: number, uv: number, vv: number, variance: number): number {
  const determinant = uu * vv - uv * uv;
  return Math.sqrt(Math.max(0, (uu - variance) * (vv - variance) - uv * uv) / determinant);
}
