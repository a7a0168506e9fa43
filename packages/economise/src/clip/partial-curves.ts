import { mainCurves } from '../motion/main-curves.js';
import { followed, type Followed } from '../motion/write-motion.js';

/** The frames of a row that count. */
export type Span = (row: number) => readonly [first: number, end: number];

const ROUNDS = 2;
/** Curves at most that missing frames are found by. */
const MOST_CURVES = 10;
/** Curves at most that a row with missing frames follows. A fit takes the third power of their number. */
const MOST_FITTED = 20;
/** Share of the frames that are enough to tell a parabola. */
const LONG = 0.3;
/** Share of what rows do as a rule that is taken for noise at least: short lives are told from by no more. */
const LEAST_NOISE = 1e-6;
/** Rows whose shares tell how much a curve is followed as a rule. */
const SAMPLES = 4000;

/**
 * The curves that rows follow most in the frames that count, and how much of each a row follows: in the other frames rows become what their curves go on with.
 * @param changes [rows, frames]; what does not count is overwritten
 * @param least see `leastCurve`
 */
export function followedWithin(changes: Float32Array, frames: number, span: Span, least: number): Followed {
  const rows = changes.length / frames;
  const partial: number[] = [];
  for (let row = 0; row < rows; row++) {
    const [first, end] = span(row);
    if (end - first < frames) partial.push(row);
  }
  const complete = (curves: readonly Float64Array[], powers: readonly number[]): void => {
    const fit = new RowFit(curves, powers, least);
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
    const curves = mainCurves(changes, frames, least).slice(0, MOST_CURVES);
    complete(curves, powersOf(changes, frames, curves));
  }
  const found = followed(changes, frames, least);
  const { curves, shares } = found;
  if (partial.length > 0 && curves.length > 0) {
    const main = curves.slice(0, MOST_FITTED);
    const fit = new RowFit(main, powersOf(changes, frames, main), least);
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

/** Legendre's polynomials up to the second over the frames, each of root mean square 1, or about: what is thrown follows them. */
function parabolas(frames: number): Float64Array[] {
  const of = (value: (x: number) => number): Float64Array =>
    Float64Array.from({ length: frames }, (_, f) => value((2 * f + 1) / frames - 1));
  return [of(() => 1), of((x) => Math.sqrt(3) * x), of((x) => Math.sqrt(5) * (1.5 * x * x - 0.5))];
}

/** Mean squares of how much rows follow each curve that have enough frames to tell. */
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

/** Mean squares of how much rows follow each curve. */
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

/** Least squares of rows of which some frames count; curves that rows hardly follow as a rule are held near 0. */
class RowFit {
  readonly #curves: readonly Float64Array[];
  readonly #weights: readonly number[];
  readonly #matrix: Float64Array;
  readonly #solution: Float64Array;

  constructor(curves: readonly Float64Array[], powers: readonly number[], noise: number) {
    this.#curves = curves;
    const known = powers.reduce((sum, power) => sum + (power === Infinity ? 0 : power), 0);
    const floor = Math.max(noise ** 2, LEAST_NOISE * known);
    this.#weights = powers.map((power) => (power === Infinity ? 0 : floor / Math.max(power, 1e-30)));
    this.#matrix = new Float64Array(curves.length ** 2);
    this.#solution = new Float64Array(curves.length);
  }

  /** How much a row follows each curve, in the frames from `first` on, before `end`. The array is used again. */
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

/** Solves a symmetric positive system by Cholesky's factor, of which the lower triangle is given. */
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
