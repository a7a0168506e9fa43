import { mainCurves } from './main-curves.js';
import { followed, minCurveStep, sharesOf, type Followed } from './curves.js';

/** Returns the range of valid frames of a row: from `first` to `end`, excluding `end`. */
export type Span = (row: number) => readonly [first: number, end: number];

const ROUNDS = 2;
/** Maximum number of curves that predict missing frames. */
const MAX_CURVES = 10;
/** Maximum number of curves for a row with missing frames, because the cost of a fit grows with its third power. */
const MAX_FITTED = 20;
/** Minimum fraction of valid frames of the rows that determine typical and largest weights. */
const LONG = 0.3;
/** Maximum ratio of the weights of other rows to these, or to their own values. */
const LARGER = 2;
/** Factors of the regularization of rows with larger weights. */
const [FIRMER, FIRMEST] = [100, 1e14];
/** Minimum noise of a fit, as a fraction of the typical power of rows. It limits weights of rows with few frames. */
const MIN_NOISE = 1e-10;
/** Approximate number of rows that are sampled for the typical weight of each curve. */
const SAMPLES = 4000;
/** Maximum number of factorizations that a fit keeps, one for each span: some MB. */
const MAX_FACTORS = 2000;

/**
 * Finds the curves that approximate rows best in their valid frames, and their weights for each row. Rows that are valid
 * in all frames have different curves than other rows, because they rarely move alike. A weight of 0 needs almost no bits.
 * @param changes [rows, frames] changes; those of invalid frames are overwritten.
 * @param min Minimum root mean square weight of a curve; see `minCurve`.
 */
export function followedWithin(changes: Float32Array, frames: number, span: Span, min: number): Followed {
  const rows = changes.length / frames;
  const [staying, passing]: [number[], number[]] = [[], []];
  for (let row = 0; row < rows; row++) {
    const [first, end] = span(row);
    (end - first < frames ? passing : staying).push(row);
  }
  if (passing.length === 0) return followed(changes, frames, min);
  const found = [staying, passing].map((own) => {
    if (own.length === 0) return followed(changes.subarray(0, 0), frames, min);
    // A part of the rows has these curves, so that their mean weight over all rows is smaller.
    const ownMin = min * Math.sqrt(rows / own.length);
    const picked = rowsOf(changes, frames, own);
    if (own === staying) return followed(picked, frames, ownMin);
    const spans = own.map(span);
    const inFrames = followedPartly(picked, frames, (k) => spans[k], ownMin);
    const inAges = followedPartly(
      agedRows(changes, frames, own, span),
      frames,
      (k) => [0, spans[k][1] - spans[k][0]],
      ownMin,
    );
    return bitsOf(inAges, min) < bitsOf(inFrames, min) ? { ...inAges, isAged: true } : inFrames;
  });
  // A file has at most as many curves as frames.
  if (found.reduce((sum, { curves }) => sum + curves.length, 0) > frames)
    return followedPartly(changes, frames, span, min);
  const spread = (own: readonly number[], shares: Float32Array): Float32Array => {
    const all = new Float32Array(rows);
    own.forEach((row, k) => (all[row] = shares[k]));
    return all;
  };
  return {
    ...{ rows, frames },
    curves: found.flatMap(({ curves }) => curves),
    shares: found.flatMap(({ shares }, kind) => shares.map((own) => spread([staying, passing][kind], own))),
    passing: found[1].curves.length,
    isAged: found[1].isAged,
  };
}

function rowsOf(changes: Float32Array, frames: number, rows: readonly number[]): Float32Array {
  const picked = new Float32Array(frames * rows.length);
  rows.forEach((row, k) => picked.set(changes.subarray(frames * row, frames * (row + 1)), frames * k));
  return picked;
}

/** Returns rows over the ages of their splats: each begins with its first valid frame. */
function agedRows(changes: Float32Array, frames: number, rows: readonly number[], span: Span): Float32Array {
  const picked = new Float32Array(frames * rows.length);
  rows.forEach((row, k) => {
    const [first, end] = span(row);
    picked.set(changes.subarray(frames * row + first, frames * row + end), frames * k);
  });
  return picked;
}

/** Returns the approximate number of bits of the weights of curves. @param min As for {@link followedWithin}. */
function bitsOf({ shares }: Followed, min: number): number {
  const step = minCurveStep(min);
  let bits = 0;
  for (const own of shares) for (let row = 0; row < own.length; row++) bits += Math.log2(1 + Math.abs(own[row]) / step);
  return bits;
}

/** Finds curves of rows with missing frames. Repeatedly predicts missing frames from curves, and finds the curves again. */
function followedPartly(changes: Float32Array, frames: number, span: Span, min: number): Followed {
  const rows = changes.length / frames;
  const complete = (curves: readonly Float64Array[], powers: readonly number[]): void => {
    const shares = fitted(changes, frames, span, new RowFit(curves, powers, min));
    for (let row = 0; row < rows; row++) {
      const [first, end] = span(row);
      for (let f = 0; f < frames; f++)
        if (f < first || f >= end) changes[frames * row + f] = sumOf(curves, shares, row, f);
    }
  };
  const polynomials = parabolas(frames);
  complete(polynomials, longPowers(changes, frames, span, polynomials));
  for (let round = 0; round < ROUNDS; round++) {
    const curves = mainCurves(changes, frames, min).slice(0, MAX_CURVES);
    complete(curves, powersOf(changes, frames, curves));
  }
  const curves = mainCurves(changes, frames, min);
  const main = curves.slice(0, MAX_FITTED);
  const powers = powersOf(changes, frames, main);
  const parts = { rows, frames, curves, passing: 0, isAged: false };
  if (curves.length <= MAX_FITTED)
    return { ...parts, shares: fitted(changes, frames, span, new RowFit(main, powers, min)) };
  // The other curves have what the main ones leave of valid frames.
  complete(main, powers);
  return { ...parts, shares: curves.map((curve) => sharesOf(changes, curve)) };
}

/**
 * Returns the weights of curves for rows, fitted to their valid frames. In a few frames, different curves may be nearly
 * equal, and large weights cancel each other. Such rows get smaller weights, because the range of weights limits the
 * precision of all.
 */
function fitted(changes: Float32Array, frames: number, span: Span, fit: RowFit): Float32Array[] {
  const rows = changes.length / frames;
  const shares = Array.from({ length: fit.size }, () => new Float32Array(rows));
  const put = (row: number, firmness: number): void =>
    fit
      .of(changes.subarray(frames * row, frames * (row + 1)), ...span(row), firmness)
      .forEach((share, k) => (shares[k][row] = share));
  const largest = new Float64Array(fit.size);
  const short: number[] = [];
  for (let row = 0; row < rows; row++) {
    put(row, 1);
    const [first, end] = span(row);
    // Few frames do not determine many curves.
    if (end - first < Math.min(frames, Math.max(LONG * frames, 2 * fit.size))) short.push(row);
    else shares.forEach((own, k) => (largest[k] = Math.max(largest[k], Math.abs(own[row]))));
  }
  for (const row of short.length < rows ? short : []) {
    const [first, end] = span(row);
    const own = changes
      .subarray(frames * row + first, frames * row + end)
      .reduce((max, value) => Math.max(max, Math.abs(value)), 0);
    const isLarge = (): boolean => shares.some((all, k) => Math.abs(all[row]) > LARGER * Math.max(largest[k], own));
    for (let firmness = FIRMER; isLarge() && firmness <= FIRMEST; firmness *= FIRMER) put(row, firmness);
  }
  return shares;
}

const sumOf = (
  curves: readonly Float64Array[],
  shares: readonly Float32Array[],
  row: number,
  frame: number,
): number => {
  let sum = 0;
  for (let k = 0; k < curves.length; k++) sum += shares[k][row] * curves[k][frame];
  return sum;
};

/**
 * Returns the Legendre polynomials of degree 0 to 2 over the frames, with a root mean square of about 1. Thrown objects
 * move along such parabolas.
 */
function parabolas(frames: number): Float64Array[] {
  const of = (value: (x: number) => number): Float64Array =>
    Float64Array.from({ length: frames }, (_, f) => value((2 * f + 1) / frames - 1));
  return [of(() => 1), of((x) => Math.sqrt(3) * x), of((x) => Math.sqrt(5) * (1.5 * x * x - 0.5))];
}

/** Returns the mean squared weight of each curve over rows with enough valid frames. */
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

/** Returns the mean squared weight of each curve over rows without missing frames. */
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

/** Least squares fit of rows with missing frames. Regularization reduces the weights of curves with little power. */
class RowFit {
  readonly #curves: readonly Float64Array[];
  readonly #weights: readonly number[];
  /** [frames + 1, size, size] sums over the frames before a frame of the products of two curves, b <= a. */
  readonly #products: Float64Array;
  /** Factorizations without firmness by span, which many rows share. */
  readonly #factors = new Map<number, Float64Array>();
  readonly #solution: Float64Array;

  constructor(curves: readonly Float64Array[], powers: readonly number[], noise: number) {
    this.#curves = curves;
    const known = powers.reduce((sum, power) => sum + (power === Infinity ? 0 : power), 0);
    const floor = Math.max(noise ** 2, MIN_NOISE * known);
    this.#weights = powers.map((power) => (power === Infinity ? 0 : floor / Math.max(power, 1e-30)));
    const square = curves.length ** 2;
    const frames = curves[0]?.length ?? 0;
    this.#products = new Float64Array((frames + 1) * square);
    for (let f = 0, at = 0; f < frames; f++)
      for (const one of curves)
        for (const other of curves) this.#products[square + at] = this.#products[at++] + one[f] * other[f];
    this.#solution = new Float64Array(curves.length);
  }

  /** Number of curves. */
  get size(): number {
    return this.#curves.length;
  }

  /**
   * Returns the weight of each curve, fitted to the frames `first` to `end` of a row. The next call reuses the array.
   * @param firmness Factor of the regularization.
   */
  of(row: Float32Array, first: number, end: number, firmness = 1): Float64Array {
    const [curves, solution] = [this.#curves, this.#solution];
    for (let a = 0; a < curves.length; a++) {
      const curve = curves[a];
      let right = 0;
      for (let f = first; f < end; f++) right += row[f] * curve[f];
      solution[a] = right;
    }
    substitute(this.#factorOf(first, end, firmness), solution);
    return solution;
  }

  #factorOf(first: number, end: number, firmness: number): Float64Array {
    const key = (this.#products.length + 1) * first + end;
    const known = firmness === 1 ? this.#factors.get(key) : undefined;
    if (known !== undefined) return known;
    const [size, products] = [this.size, this.#products];
    const [from, to] = [size * size * first, size * size * end];
    const matrix = new Float64Array(size * size);
    for (let a = 0; a < size; a++) {
      for (let at = size * a; at <= (size + 1) * a; at++) matrix[at] = products[to + at] - products[from + at];
      matrix[(size + 1) * a] += firmness * this.#weights[a];
    }
    factorize(matrix, size);
    if (firmness === 1 && this.#factors.size < MAX_FACTORS) this.#factors.set(key, matrix);
    return matrix;
  }
}

/** Replaces the lower triangle of a symmetric positive definite matrix by its Cholesky factor. */
function factorize(matrix: Float64Array, size: number): void {
  for (let a = 0; a < size; a++) {
    for (let b = 0; b <= a; b++) {
      let sum = matrix[size * a + b];
      for (let k = 0; k < b; k++) sum -= matrix[size * a + k] * matrix[size * b + k];
      matrix[size * a + b] = a === b ? Math.sqrt(Math.max(sum, 1e-30)) : sum / matrix[size * b + b];
    }
  }
}

/** Solves a system by the Cholesky factor of its matrix. @param solution Right side; becomes the solution. */
function substitute(factor: Float64Array, solution: Float64Array): void {
  const size = solution.length;
  for (let a = 0; a < size; a++) {
    for (let k = 0; k < a; k++) solution[a] -= factor[size * a + k] * solution[k];
    solution[a] /= factor[size * a + a];
  }
  for (let a = size - 1; a >= 0; a--) {
    for (let k = a + 1; k < size; k++) solution[a] -= factor[size * k + a] * solution[k];
    solution[a] /= factor[size * a + a];
  }
}
