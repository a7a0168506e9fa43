import type { GaussianCloud } from '@gaussian-splat/core';
import type { Evaluator } from '../evaluator.js';
import { findTrades, type FitOptions, type Trades } from '../fit.js';
import { decibels, errorTogether } from '../measure.js';
import type { Cut, ReducedCloud } from '../reduce.js';
import type { Ranking } from '../score.js';

/**
 * Assumed fraction of the error of drops and merges that remains after refinement. The search for a cut allows an error
 * that is larger by the inverse; the error after refinement is then measured.
 */
export const LEFT_BY_REFINING = 0.4;
/** Maximum number of cuts to refine; and the fraction of the allowed error above which a cut ends the search. */
const TRIES = 4;
const NEAR_ENOUGH = 0.97;
/** Ratio of the smallest budget that exceeds the limit to the largest within it, below which the search ends. */
const NARROW = 1.03;
/** Range of the exponent of the error as a function of the budget. Estimates from two tries are clamped to it. */
const [MIN_SLOPE, MAX_SLOPE] = [0.5, 2];

/** Size of the cut, and whether to refine it. */
export interface Plan {
  readonly trades: Trades;
  /** Budget of the cut as a factor of the allowed error. */
  readonly filling: number;
  readonly isRefined: boolean;
}

/** A cut, and the cloud after this cut and its refinement, if any. */
export interface CutCloud {
  readonly cut: Cut;
  readonly reduced: ReducedCloud;
}

/** Result of a try: the factor of the budget, and the larger error of the search and held-out views. */
interface Tried {
  readonly filling: number;
  readonly error: number;
}

/** Applies the cut of a plan, and refines the result if the plan says so and the evaluator can refine. */
export async function cutCloud(
  { trades, filling, isRefined }: Plan,
  evaluator: Evaluator,
  budget: number,
  signal: AbortSignal | undefined,
): Promise<CutCloud> {
  const cut = trades.cutAt(filling * budget);
  const reduced = await evaluator.reduce(cut, signal);
  return { cut, reduced: (isRefined && (await evaluator.refine?.(reduced, signal))) || reduced };
}

/**
 * Refines a few cuts, and returns the largest one whose error is within the limit in both the search views and the
 * held-out views. Refinement does not fit the splats to these views.
 * @param budget Maximum mean squared error, peak 1.
 * @returns Undefined if all refined cuts exceed the limit.
 */
export async function searchRefined(
  cloud: GaussianCloud,
  ranking: Ranking,
  evaluator: Evaluator,
  budget: number,
  options: FitOptions,
): Promise<(CutCloud & { readonly plan: Plan }) | undefined> {
  const { signal, onStep = () => undefined } = options;
  const trades = await findTrades(cloud, ranking, evaluator, budget, { ...options, leftByRefining: LEFT_BY_REFINING });
  const tried: Tried[] = [];
  let best: (CutCloud & { readonly plan: Plan }) | undefined;
  let next = 1;
  for (let tries = 0; tries < TRIES; tries++) {
    onStep(`refining what ${next.toFixed(2)} of the expected error allows`);
    const plan = { trades, filling: next, isRefined: true };
    const found = { plan, ...(await cutCloud(plan, evaluator, budget, signal)) };
    const errors: number[] = [];
    for (const views of ['searched', 'heldOut'] as const)
      errors.push(errorTogether(await evaluator.sketch(found.reduced.cloud, views, signal), views));
    const error = Math.max(...errors);
    onStep(`refined: ${decibels(error).toFixed(2)} dB, ${found.reduced.cloud.count} splats`);
    tried.push({ filling: next, error });
    if (error <= budget && next > (best?.plan.filling ?? 0)) best = found;
    if (error <= budget && error > NEAR_ENOUGH * budget) break;
    const [fits, fails] = bracketOf(tried, budget);
    if (fails < NARROW * fits) break;
    next = nextFilling(tried, budget);
    if (tried.some(({ filling }) => filling === next)) break;
  }
  return best;
}

/** Returns the largest `filling` within the error limit, or 0; and the smallest that exceeds the limit, or Infinity. */
function bracketOf(tried: readonly Tried[], budget: number): [number, number] {
  const fits = Math.max(0, ...tried.filter(({ error }) => error <= budget).map(({ filling }) => filling));
  const fails = Math.min(Infinity, ...tried.filter(({ error }) => error > budget).map(({ filling }) => filling));
  return [fits, fails];
}

/** Returns the `filling` of the next try: extrapolated from the last two tries, within the result of `bracketOf`. */
function nextFilling(tried: readonly Tried[], budget: number): number {
  const [last, before] = [tried[tried.length - 1], tried[tried.length - 2]];
  const measured = before && Math.log(last.error / before.error) / Math.log(last.filling / before.filling);
  const slope = Math.min(MAX_SLOPE, Math.max(MIN_SLOPE, measured ?? 1));
  const guess = last.filling * ((0.985 * budget) / last.error) ** (1 / slope);
  const [fits, fails] = bracketOf(tried, budget);
  if (guess > fits && guess < fails) return guess;
  return fits > 0 && fails < Infinity ? Math.sqrt(fits * fails) : fits > 0 ? 1.2 * fits : 0.8 * fails;
}
