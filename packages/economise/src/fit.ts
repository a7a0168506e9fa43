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
/** Two scores are compared at this fraction. */
const TRIAL_SHARE = 0.06;
/** Measured prices of a coefficient. */
const PRICES = Array.from({ length: 14 }, (_, k) => 10 ** (-14.5 + 0.5 * k));
/** Numbers of a splat besides its harmonics. */
const OTHER_NUMBERS = 11;
/** Number of cuts to try in the held-out views, and the fraction of the allowed error that ends the search. */
const FIT_TRIES = 6;
const NEAR_ENOUGH = 0.99;

/** Cuts that trade size for error. */
export interface Trades {
  /** Returns the cut that saves the most numbers of the file within a mean squared error, from measurements. */
  readonly cutAt: (error: number) => Cut;
}

/** Options of the search. */
export interface FitOptions {
  /**
   * Fraction of the error of drops and merges that remains after refinement; 1, the default, without refinement. The
   * error of fewer bands does not change.
   */
  readonly leftByRefining?: number;
  /** Whether every splat of the file takes as many coefficients as the one with the most: see `Encoding`. */
  readonly hasOneDegree?: boolean;
  readonly signal?: AbortSignal;
  readonly onStep?: (step: string) => void;
}

/** A candidate score for dropping, with thresholds. */
interface Dropping {
  readonly thresholds: readonly number[];
  readonly cutAt: (threshold: number) => Cut;
}

/** Measures, in the search views, the separate costs of dropping splats and of dropping bands of color. */
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
  onStep('measuring what fewer bands of colour cost');
  const color = await along(cloud.shDegree > 0 ? PRICES : [], (colorPrice) => ({ colorPrice }), 1, hasOneDegree);
  const trades: Trades = {
    cutAt: (error) => {
      const [dropped, colored] = bestTrades(drop, color, error);
      // The GPU compares in float32.
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
 * Number of coefficients in a file, from the count of splats of each degree. @param hasOneDegree Whether all take as
 * many as those of the highest.
 */
export function numbersOf(degrees: readonly number[], hasOneDegree = false): number {
  if (hasOneDegree) return numbersOf(atHighest(degrees));
  return degrees.reduce((sum, splats, degree) => sum + splats * (OTHER_NUMBERS + 3 * (degree + 1) ** 2), 0);
}

/** The same number of splats, all of the highest degree that occurs. */
function atHighest(degrees: readonly number[]): number[] {
  const count = degrees.reduce((sum, splats) => sum + splats, 0);
  const highest = degrees.findLastIndex((splats) => splats > 0);
  return degrees.map((_, degree) => (degree === highest ? count : 0));
}

/**
 * Selects thresholds of the better score at the trial fraction: the error of single views, or the largest weight in a
 * pixel. The former accounts for the size of a splat and the splats behind it, the latter is more careful with splats
 * that are removed together; the better one depends on the scene.
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
    // Splats without any cost are dropped first, for any budget.
    return { trial, dropped: [smallestAboveZero(values), ...dropped], cutAt };
  });
  const trials: number[] = [];
  for (const { trial, cutAt } of candidates)
    trials.push(errorTogether((await evaluator.cut(cutAt(trial), 'searched', signal)).errors, 'searched'));
  const { dropped, cutAt } = candidates[trials[0] <= trials[1] ? 0 : 1];
  const thresholds = [...new Set(dropped)].filter((price) => price > 0 && Number.isFinite(price));
  return { thresholds, cutAt };
}

/** GPUs may flush smaller numbers to 0. */
const MIN_NORMAL = 2 ** -126;

function smallestAboveZero(values: Float32Array): number {
  let min = Infinity;
  for (let i = 0; i < values.length; i++) if (values[i] >= MIN_NORMAL && values[i] < min) min = values[i];
  return min;
}

/**
 * Finds the fraction of the search's budget that keeps the held-out views within the error, too: they can only reduce
 * it.
 * @returns A fraction in 0..1; 0 if there is none.
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
    // Errors are nearly proportional to the budget, but in steps if there are few splats: an error that did not
    // decrease is no basis for extrapolation.
    const guess = (next * 0.995 * budget) / error;
    next = guess > fits && guess < fails && error !== last ? guess : (fits + Math.min(1, fails)) / 2;
    last = error;
  }
  return fits;
}
