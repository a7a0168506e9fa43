import type { GaussianCloud } from '@gaussian-splat/core';
import type { CutFigures, Evaluator } from './evaluator.js';
import { tradeMerges, type MeasuredCut } from './merge/trade-merges.js';
import { errorTogether } from './measure.js';
import { valuesAtPlaces } from './order.js';
import type { Cut } from './reduce.js';
import type { Ranking } from './score.js';
import { bestTrades, measureTrades, type TradeCurve } from './search.js';

/** Fractions of splats whose removal is measured, least important first. */
const DROPPED_SHARES = [0.01, 0.02, 0.035, 0.05, 0.07, 0.1, 0.14, 0.19, 0.25, 0.32, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9];
/** Fraction of dropped splats for the comparison of two scores. */
const TRIAL_SHARE = 0.06;
/** Values of `Cut.colorPrice` that are measured. */
const PRICES = Array.from({ length: 14 }, (_, k) => 10 ** (-14.5 + 0.5 * k));
/** Count of numbers of a splat without its spherical harmonics. */
const OTHER_NUMBERS = 11;
/** Maximum number of cuts that are tried in the held-out views. The fraction of the allowed error ends the search. */
const FIT_TRIES = 6;
const NEAR_ENOUGH = 0.99;

/** Measured relation between the size of cuts and their error. */
export interface Trades {
  /** Returns the cut that saves the most numbers of the file within a mean squared error. */
  readonly cutAt: (error: number) => Cut;
}

/** Options of {@link findTrades} and {@link scaleToFit}. */
export interface FitOptions {
  /**
   * Fraction of the error of dropped and merged splats that remains after refinement, 0..1; default 1, without refinement.
   * Refinement does not reduce the error of removed bands.
   */
  readonly leftByRefining?: number;
  /** Whether the file has the same number of coefficients for every splat; see `Encoding.hasOneDegree`. */
  readonly hasOneDegree?: boolean;
  readonly signal?: AbortSignal;
  readonly onStep?: (step: string) => void;
}

/**
 * Cuts that drop splats by one score. `cutAt` returns the cut for a threshold of the score. `thresholds` are those whose
 * error is to be measured.
 */
interface Dropping {
  readonly thresholds: readonly number[];
  readonly cutAt: (threshold: number) => Cut;
}

/**
 * Measures, in the searched views, the error of dropping splats, of removing bands of color, and of merging splats, each
 * for several thresholds.
 * @param budget Allowed mean squared error, which ends each series of measurements.
 */
export async function findTrades(
  cloud: GaussianCloud,
  ranking: Ranking,
  evaluator: Evaluator,
  budget: number,
  { leftByRefining: left = 1, hasOneDegree = false, signal, onStep = () => undefined }: FitOptions,
): Promise<Trades> {
  const numbers = (degrees: readonly number[]): number => numbersOf(degrees, hasOneDegree);
  const all = cloud.count * (OTHER_NUMBERS + 3 * (cloud.shDegree + 1) ** 2);
  const along = (
    thresholds: readonly number[],
    cutAt: (threshold: number) => Cut,
    part: number,
    isStepped = false,
  ): Promise<TradeCurve> =>
    measureTrades(
      thresholds,
      async (threshold) => {
        const { errors, degrees } = await evaluator.cut(cutAt(threshold), 'searched', signal);
        return { threshold, error: part * errorTogether(errors, 'searched'), saved: all - numbers(degrees) };
      },
      budget,
      isStepped,
    );
  onStep('measuring what dropped splats cost');
  const dropping = await chooseDropping(ranking, evaluator, signal);
  const drop = await along(dropping.thresholds, dropping.cutAt, left);
  onStep('measuring what fewer bands of color cost');
  const color = await along(cloud.shDegree > 0 ? PRICES : [], (colorPrice) => ({ colorPrice }), 1, hasOneDegree);
  const trades: Trades = {
    cutAt: (error) => {
      const [dropped, colored] = bestTrades(drop, color, error);
      // Thresholds are rounded, because the GPU compares them in float32.
      const [threshold, colorPrice] = [Math.fround(dropped.threshold), Math.fround(colored.threshold)];
      return { ...dropping.cutAt(threshold), colorPrice };
    },
  };
  const { mergePrices } = evaluator;
  if (mergePrices === undefined) return trades;
  onStep('measuring what merged splats cost');
  const merge = await along(mergePrices, (mergePrice) => ({ mergePrice }), left);
  const saved = ({ degrees }: CutFigures): number => all - numbers(degrees);
  const measure = async (cut: Cut): Promise<MeasuredCut> => {
    const figures = await evaluator.cut(cut, 'searched', signal);
    const error = errorTogether(figures.errors, 'searched');
    if (left === 1) return { error, saved: saved(figures) };
    const { errors } = await evaluator.cut({ ...cut, colorPrice: 0 }, 'searched', signal);
    return { error: error - (1 - left) * Math.min(error, errorTogether(errors, 'searched')), saved: saved(figures) };
  };
  return tradeMerges(trades, merge, budget, measure);
}

/**
 * Returns the count of numbers in a file, from the number of splats of each degree.
 * @param hasOneDegree Whether the file has the same number of coefficients for every splat.
 */
export function numbersOf(degrees: readonly number[], hasOneDegree = false): number {
  if (hasOneDegree) return numbersOf(atHighest(degrees));
  return degrees.reduce((sum, splats, degree) => sum + splats * (OTHER_NUMBERS + 3 * (degree + 1) ** 2), 0);
}

/** Returns the number of splats of each degree if all splats had the highest degree that occurs. */
function atHighest(degrees: readonly number[]): number[] {
  const count = degrees.reduce((sum, splats) => sum + splats, 0);
  const highest = degrees.findLastIndex((splats) => splats > 0);
  return degrees.map((_, degree) => (degree === highest ? count : 0));
}

/**
 * Returns the score with the smaller error when {@link TRIAL_SHARE} of the splats are dropped. The removal error accounts
 * for the size of a splat and the splats behind it. The largest weight in a pixel is safer for splats that are removed
 * together. Which is better depends on the scene.
 */
async function chooseDropping(
  { removalError, contribution }: Ranking,
  evaluator: Evaluator,
  signal: AbortSignal | undefined,
): Promise<Dropping> {
  const candidates = [
    { values: removalError, cutAt: (removalPrice: number): Cut => ({ removalPrice }) },
    { values: contribution, cutAt: (minContribution: number): Cut => ({ minContribution }) },
  ].map(({ values, cutAt }) => {
    const places = [TRIAL_SHARE, ...DROPPED_SHARES].map((share) => Math.floor(share * (values.length - 1)));
    const [trial, ...dropped] = valuesAtPlaces(values, places);
    // The first threshold drops only splats with a score of 0, which any budget allows.
    return { trial, dropped: [smallestAboveZero(values), ...dropped], cutAt };
  });
  const trials: number[] = [];
  for (const { trial, cutAt } of candidates)
    trials.push(errorTogether((await evaluator.cut(cutAt(trial), 'searched', signal)).errors, 'searched'));
  const { dropped, cutAt } = candidates[trials[0] <= trials[1] ? 0 : 1];
  const thresholds = [...new Set(dropped)].filter((price) => price > 0 && Number.isFinite(price));
  return { thresholds, cutAt };
}

/** Smallest normal float32. GPUs may flush smaller numbers to 0. */
const MIN_NORMAL = 2 ** -126;

function smallestAboveZero(values: Float32Array): number {
  let min = Infinity;
  for (let i = 0; i < values.length; i++) if (values[i] >= MIN_NORMAL && values[i] < min) min = values[i];
  return min;
}

/**
 * Finds the largest fraction of a budget that keeps the error of the held-out views within the budget, too.
 * @param budget Allowed mean squared error.
 * @returns A fraction, 0..1. 0 if no cut is within the budget.
 */
export async function scaleToFit(
  { cutAt }: Trades,
  evaluator: Evaluator,
  budget: number,
  { signal, onStep = () => undefined }: FitOptions,
): Promise<number> {
  onStep('finding what the held-out views allow');
  let [fits, fails, next, last] = [0, Infinity, 1, Infinity];
  for (let tries = 0; tries < FIT_TRIES; tries++) {
    const { errors } = await evaluator.cut(cutAt(next * budget), 'heldOut', signal);
    const error = errorTogether(errors, 'heldOut');
    if (error <= budget) fits = next;
    else fails = next;
    if (fits === 1 || (error <= budget && error > NEAR_ENOUGH * budget)) break;
    // Errors are nearly proportional to the budget, but change in steps if there are few splats. Therefore an error that
    // has not changed is not extrapolated.
    const guess = (next * 0.995 * budget) / error;
    next = guess > fits && guess < fails && error !== last ? guess : (fits + Math.min(1, fails)) / 2;
    last = error;
  }
  return fits;
}
