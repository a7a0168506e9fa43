import { mainCurves } from '../motion/main-curves.js';
import { followed, type Followed } from '../motion/write-motion.js';

/** Range of valid frames of a row. */
export type Span = (row: number) => readonly [first: number, end: number];

const ROUNDS = 2;
/** Missing frames are predicted from at most this number of curves. */
const MAX_CURVES = 10;
/** Maximum number of curves for a row with missing frames, because the cost of a fit grows with its third power. */
const MAX_FITTED = 20;
/** Minimum fraction of valid frames for fitting a parabola. */
const LONG = 0.3;
/** Minimum noise, as a fraction of the typical power of rows: limits the weights that short lifetimes determine. */
const MIN_NOISE = 1e-6;
/** Sampled rows for the typical weight of each curve. */
const SAMPLES = 4000;

/**
 * Finds the curves that rows follow most in their valid frames, and their weights for each row; in the other frames
 * rows are replaced by the continuation of the curves.
 * @param changes [rows, frames]; invalid entries are overwritten.
 * @param least See `minCurve`.
 */
export function followedWithin(changes: Float32Array, frames: number, span: Span, min: number): Followed {
  const rows = changes.length / frames;
  const partial: number[] = [];
  for (let row = 0; row < rows; row++) {
    const [first, end] = span(row);
    if (end - first < frames) partial.push(row);
  }
  const complete = (curves: readonly Float64Array[], powers: readonly number[]): void => {
    const fit = new RowFit(curves, powers, min);
    for (const row of partial) {
      const own = changes.subarray(frames * row, frames * (row + 1));
      const [first, end] = span(row);
      const shares = fit.of(own, first, end);
      for (let f = 0; f < frames; f++) if (f < first || f >= end) own[f] = sumOf(curves, shares, f);
    }
  };
  if (partial.length > 0) {
    const polynomials = parabolas(frames);
    complete(polynomials, longPowers(changes, frames, span, polynomials));
  }
  for (let round = 0; partial.length > 0 && round < ROUNDS; round++) {
    const curves = mainCurves(changes, frames, min).slice(0, MAX_CURVES);
    complete(curves, powersOf(changes, frames, curves));
  }
  const found = followed(changes, frames, min);
  const { curves, shares } = found;
  if (partial.length > 0 && curves.length > 0) {
    const main = curves.slice(0, MAX_FITTED);
    const fit = new RowFit(main, powersOf(changes, frames, main), min);
    for (const row of partial) {
      const own = fit.of(changes.subarray(frames * row, frames * (row + 1)), ...span(row));
      shares.forEach((share, k) => (share[row] = own[k] ?? 0));
    }
  }
  return found;
}

const sumOf = (curves: readonly Float64Array[], shares: Float64Array, frame: number): number => {
  let sum = 0;
  for (let k = 0; k < curves.length; k++) sum += shares[k] * curves[k][frame];
  return sum;
};

/**
 * Legendre polynomials up to degree two over the frames, each with a root mean square of about 1, because thrown
 * objects follow them.
 */
function parabolas(frames: number): Float64Array[] {
  const of = (value: (x: number) => number): Float64Array =>
    Float64Array.from({ length: frames }, (_, f) => value((2 * f + 1) / frames - 1));
  return [of(() => 1), of((x) => Math.sqrt(3) * x), of((x) => Math.sqrt(5) * (1.5 * x * x - 0.5))];
}

/** Mean squared weight of each curve over rows with enough frames. */
function longPowers(changes: Float32Array, frames: number, span: Span, curves: readonly Float64Array[]): number[] {
  const rows = changes.length / frames;
  const fit = new RowFit(
    curves,
    curves.map(() => Infinity),
    0,
  );
  const sums = curves.map(() => 0);
  let used = 0;
  const stride = Math.max(1, Math.floor(rows / SAMPLES));
  for (let row = 0; row < rows; row += stride) {
    const [first, end] = span(row);
    if (end - first < LONG * frames) continue;
    fit
      .of(changes.subarray(frames * row, frames * (row + 1)), first, end)
      .forEach((share, k) => (sums[k] += share ** 2));
    used++;
  }
  return sums.map((sum) => sum / Math.max(1, used));
}

/** Mean squared weight of each curve over the rows. */
function powersOf(changes: Float32Array, frames: number, curves: readonly Float64Array[]): number[] {
  const rows = changes.length / frames;
  const stride = Math.max(1, Math.floor(rows / SAMPLES));
  return curves.map((curve) => {
    let [sum, used] = [0, 0];
    for (let row = 0; row < rows; row += stride, used++) {
      let share = 0;
      for (let f = 0; f < frames; f++) share += changes[frames * row + f] * curve[f];
      sum += (share / frames) ** 2;
    }
    return sum / used;
  });
}

/** Least squares fit of rows with missing frames; the weights of unusual curves are regularized towards 0. */
class RowFit {
  readonly #curves: readonly Float64Array[];
  readonly #weights: readonly number[];
  readonly #matrix: Float64Array;
  readonly #solution: Float64Array;

  constructor(curves: readonly Float64Array[], powers: readonly number[], noise: number) {
    this.#curves = curves;
    const known = powers.reduce((sum, power) => sum + (power === Infinity ? 0 : power), 0);
    const floor = Math.max(noise ** 2, MIN_NOISE * known);
    this.#weights = powers.map((power) => (power === Infinity ? 0 : floor / Math.max(power, 1e-30)));
    this.#matrix = new Float64Array(curves.length ** 2);
    this.#solution = new Float64Array(curves.length);
  }

  /** Weights of a row's curves, fitted to the frames from `first` on, before `end`. The array is reused. */
  of(row: Float32Array, first: number, end: number): Float64Array {
    const [curves, matrix, solution] = [this.#curves, this.#matrix, this.#solution];
    const size = curves.length;
    for (let a = 0; a < size; a++) {
      let right = 0;
      for (let f = first; f < end; f++) right += row[f] * curves[a][f];
      solution[a] = right;
      for (let b = 0; b <= a; b++) {
        let sum = a === b ? this.#weights[a] : 0;
        for (let f = first; f < end; f++) sum += curves[a][f] * curves[b][f];
        matrix[size * a + b] = sum;
      }
    }
    solveInPlace(matrix, solution, size);
    return solution;
  }
}

/** Solves a symmetric positive definite system with a Cholesky factorization; only the lower triangle is given. */
function solveInPlace(matrix: Float64Array, solution: Float64Array, size: number): void {
  for (let a = 0; a < size; a++) {
    for (let b = 0; b <= a; b++) {
      let sum = matrix[size * a + b];
      for (let k = 0; k < b; k++) sum -= matrix[size * a + k] * matrix[size * b + k];
      matrix[size * a + b] = a === b ? Math.sqrt(Math.max(sum, 1e-30)) : sum / matrix[size * b + b];
    }
  }
  for (let a = 0; a < size; a++) {
    for (let k = 0; k < a; k++) solution[a] -= matrix[size * a + k] * solution[k];
    solution[a] /= matrix[size * a + a];
  }
  for (let a = size - 1; a >= 0; a--) {
    for (let k = a + 1; k < size; k++) solution[a] -= matrix[size * k + a] * solution[k];
    solution[a] /= matrix[size * a + a];
  }
}
