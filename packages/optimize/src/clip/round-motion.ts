/** Quantization of the weights of curves, with the error of the worst frame in mind. */
import { curveBitsFor, roundedCurveValue, type AnimatedAttribute } from '@gaussian-splat/formats';
import type { Followed } from './curves.js';

/**
 * Penalty of a level of a code for a splat of average importance, in levels. Zeros and small codes need few bits. Codes
 * of unimportant splats shrink further, by up to the second number.
 */
const [SHRINKING, MAX_SHRINKING] = [0.05, 1.5];
/** Maximum error of the curves that are not written, in any frame, as a fraction of the squared step. */
const MAX_DROPPED = 0.02;
/** Number of neighboring rows whose mean error counts, because an error may be concentrated in a region. */
const REGION = 64;
/** Weight of the error of a region relative to that of all rows. */
const REGION_SHARE = 0.25;
/** Maximum energy of the differences from the mean weight of all splats, relative to that of all weights. */
const COMMON_REST = 0.1;
/** Factor of the precision of curves that all splats follow, in which errors of splats do not compensate each other. */
const COMMON_FINER = 64;
const MAX_CODE = 32_767;
const ROUNDS = 30;

/** Quantized motion of an attribute, and the precision of its curves. */
export interface RoundedMotion {
  readonly part: AnimatedAttribute;
  /** Number of fractional bits of each curve. */
  readonly curveBits: readonly number[];
}

export const UNCHANGED: RoundedMotion = {
  part: { rank: 0, aged: 0, step: 1, curves: new Float32Array(0), codes: [] },
  curveBits: [],
};

/**
 * Quantizes the weights of curves. The step of each curve is such that the error is about the same in all frames. Drops
 * curves that hardly change any frame.
 * @param step Typical step. It is larger if codes would overflow 16 bits.
 * @param importance [splats] effect of the attribute's error on images, 1 on average.
 */
export function roundMotion(found: Followed, step: number, importance: Float32Array): RoundedMotion {
  const { rows, frames, curves, shares, passing, isAged } = found;
  const splats = importance.length;
  const staying = curves.length - passing;
  const gains = [...evenGains(curves.slice(0, staying)), ...evenGains(curves.slice(staying))];
  const isNeeded = neededCurves(found, step);
  const means = shares.map((own, k) => (k < staying ? commonWeights(own, splats) : [0]));
  // A weight that all splats have hardly takes bytes, so that it is never rounded to 0.
  const isCommon = means.map((own) => own.some((mean) => mean !== 0));
  const ownSteps = gains.map((gain, k) => Math.min(step * gain, Math.max(...means[k].map(Math.abs)) || Infinity));
  const overflow = shares.reduce(
    (max, own, k) => own.reduce((largest, value) => Math.max(largest, Math.abs(value) / ownSteps[k]), max),
    0,
  );
  const factor = Math.max(1, overflow / MAX_CODE);
  const shrinking = Float32Array.from(importance, (weight) =>
    Math.min(MAX_SHRINKING, SHRINKING / Math.max(weight, 1e-9)),
  );
  const codes = shares.map((own, k) => {
    if (!isNeeded[k] && !isCommon[k]) return undefined;
    const rounded = new Int16Array(rows);
    const unit = factor * ownSteps[k];
    const middles = means[k].map((mean) => Math.round(mean / unit));
    let hasCode = false;
    for (let row = 0; row < rows; row++) {
      const middle = isCommon[k] ? middles[Math.floor(row / splats)] : 0;
      const apart = own[row] / unit - middle;
      const size = Math.floor(Math.abs(apart) + 0.5 - shrinking[row % splats]);
      rounded[row] = size > 0 ? middle + (apart < 0 ? -size : size) : middle;
      hasCode ||= rounded[row] !== 0;
    }
    return hasCode ? rounded : undefined;
  });
  const kept = codes.flatMap((own, k) => (own ? [{ own, k }] : []));
  const rank = kept.length;
  if (rank === 0) return UNCHANGED;
  const written = new Float32Array(frames * rank);
  const ownStep = Math.fround(factor * step);
  const curveBits = kept.map(({ own, k }, at) => {
    const gain = (ownSteps[k] / step) * fittingGain(shares[k], own, factor * ownSteps[k], importance);
    const scaled = curves[k].map((value) => gain * value);
    const largest = own.reduce((max, code) => Math.max(max, Math.abs(code)), 0);
    const bits = curveBitsFor(scaled, isCommon[k] ? (COMMON_FINER * largest * step) / ownSteps[k] : largest);
    scaled.forEach((value, f) => (written[rank * f + at] = roundedCurveValue(value, bits)));
    return bits;
  });
  const planes = Array.from({ length: rows / splats }, (_, number) =>
    kept.map(({ own }) => own.subarray(splats * number, splats * (number + 1))),
  ).flat();
  const aged = isAged ? kept.filter(({ k }) => k >= staying).length : 0;
  return { part: { rank, aged, step: ownStep, curves: written, codes: planes }, curveBits };
}

/** Returns the mean weight of each number of an attribute if nearly all splats have it; otherwise 0. */
function commonWeights(shares: Float32Array, splats: number): readonly number[] {
  const numbers = Array.from({ length: shares.length / splats }, (_, n) =>
    shares.subarray(splats * n, splats * (n + 1)),
  );
  const means = numbers.map((own) => own.reduce((sum, value) => sum + value, 0) / splats);
  let [rest, all] = [0, 0];
  numbers.forEach((own, n) => {
    for (const value of own) {
      rest += (value - means[n]) ** 2;
      all += value * value;
    }
  });
  return rest < COMMON_REST * all ? means : [0];
}

/**
 * Returns the factor of a curve with which its rounded weights have the smallest error, by least squares. Without it, weights
 * that are nearly equal would all be rounded in the same direction, and those that shrink would all be too small.
 */
function fittingGain(shares: Float32Array, codes: Int16Array, step: number, importance: Float32Array): number {
  let [products, squares] = [0, 0];
  for (let row = 0; row < codes.length; row++) {
    const weighted = importance[row % importance.length] * codes[row];
    products += weighted * shares[row];
    squares += weighted * codes[row];
  }
  return squares > 0 ? products / (squares * step) : 1;
}

/**
 * Returns relative steps of curves with which rounding errors have the same variance in all frames, as far as possible.
 * The mean variance of the worst frame is that of equal steps.
 */
function evenGains(curves: readonly Float64Array[]): number[] {
  if (curves.length === 0) return [];
  const frames = curves[0].length;
  const weights = new Float64Array(frames).fill(1);
  const noise = new Float64Array(frames);
  let squares: number[] = [];
  let worst = 1;
  for (let round = 0; round < ROUNDS; round++) {
    squares = curves.map((curve) => {
      let sum = 0;
      for (let f = 0; f < frames; f++) sum += weights[f] * curve[f] * curve[f];
      return frames / Math.max(sum, 1e-9 * frames);
    });
    noise.fill(0);
    curves.forEach((curve, k) => {
      for (let f = 0; f < frames; f++) noise[f] += squares[k] * curve[f] * curve[f];
    });
    worst = noise.reduce((max, value) => Math.max(max, value), 1e-9);
    for (let f = 0; f < frames; f++) weights[f] *= Math.max(1e-3, noise[f] / worst) ** 0.5;
  }
  return squares.map((square) => Math.sqrt((square * curves.length) / worst));
}

/**
 * Returns, for each curve, whether it is needed: without the others, no frame has an error above {@link MAX_DROPPED}, not
 * even in a region of neighboring splats.
 */
function neededCurves({ frames, curves, shares }: Followed, step: number): boolean[] {
  const energies = shares.map(energyOf);
  const order = curves.map((_, k) => k).sort((a, b) => energies[a] - energies[b]);
  const dropped = new Float64Array(frames);
  const isNeeded = curves.map(() => true);
  for (const k of order) {
    let worst = 0;
    for (let f = 0; f < frames; f++) worst = Math.max(worst, dropped[f] + energies[k] * curves[k][f] ** 2);
    if (worst > MAX_DROPPED * step * step) break;
    for (let f = 0; f < frames; f++) dropped[f] += energies[k] * curves[k][f] ** 2;
    isNeeded[k] = false;
  }
  return isNeeded;
}

/** Returns the mean square of weights: over all rows, or over the worst region at a lower weight if that is larger. */
function energyOf(shares: Float32Array): number {
  let [all, worst, own] = [0, 0, 0];
  for (let row = 0; row < shares.length; row++) {
    const square = shares[row] * shares[row];
    all += square;
    own += square;
    if ((row + 1) % REGION > 0 && row < shares.length - 1) continue;
    worst = Math.max(worst, own / REGION);
    own = 0;
  }
  return Math.max(all / shares.length, REGION_SHARE * worst);
}
