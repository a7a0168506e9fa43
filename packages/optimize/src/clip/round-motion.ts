/** Quantization of the weights of curves, with the error of the worst frame in mind. */
import { curveBitsFor, roundedCurveValue, type AnimatedAttribute } from '@gaussian-splat/formats';
import type { Followed } from './curves.js';

/**
 * Penalty of a level of a code for a splat of average importance, in levels. Zeros and small codes need few bits. Codes
 * of unimportant splats shrink further, by up to the second number.
 */
const [SHRINKING, MAX_SHRINKING] = [0.1, 1.5];
/** Maximum error of the curves that are not written, in any frame, as a fraction of the squared step. */
const MAX_DROPPED = 0.02;
/** Number of neighboring rows whose mean error counts, because an error may be concentrated in a region. */
const REGION = 64;
/** Weight of the error of a region relative to that of all rows. */
const REGION_SHARE = 0.25;
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
  const ownSteps = gains.map((gain) => step * gain);
  const overflow = shares.reduce(
    (max, own, k) => own.reduce((largest, value) => Math.max(largest, Math.abs(value) / ownSteps[k]), max),
    0,
  );
  const factor = Math.max(1, overflow / MAX_CODE);
  const shrinking = Float32Array.from(importance, (weight) =>
    Math.min(MAX_SHRINKING, SHRINKING / Math.max(weight, 1e-9)),
  );
  const codes = shares.map((own, k) => {
    if (!isNeeded[k]) return undefined;
    const rounded = new Int16Array(rows);
    let hasCode = false;
    for (let row = 0; row < rows; row++) {
      const size = Math.floor(Math.abs(own[row]) / (factor * ownSteps[k]) + 0.5 - shrinking[row % splats]);
      if (size <= 0) continue;
      rounded[row] = own[row] < 0 ? -size : size;
      hasCode = true;
    }
    return hasCode ? rounded : undefined;
  });
  const kept = codes.flatMap((own, k) => (own ? [{ own, k }] : []));
  const rank = kept.length;
  if (rank === 0) return UNCHANGED;
  const written = new Float32Array(frames * rank);
  const ownStep = Math.fround(factor * step);
  const curveBits = kept.map(({ own, k }, at) => {
    const scaled = curves[k].map((value) => gains[k] * value);
    const bits = curveBitsFor(
      scaled,
      own.reduce((max, code) => Math.max(max, Math.abs(code)), 0),
    );
    scaled.forEach((value, f) => (written[rank * f + at] = roundedCurveValue(value, bits)));
    return bits;
  });
  const planes = Array.from({ length: rows / splats }, (_, number) =>
    kept.map(({ own }) => own.subarray(splats * number, splats * (number + 1))),
  ).flat();
  const aged = isAged ? kept.filter(({ k }) => k >= staying).length : 0;
  return { part: { rank, aged, step: ownStep, curves: written, codes: planes }, curveBits };
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
