import type { GaussianCloud } from '@gaussian-splat/core';
import type { Evaluator } from '../evaluator.js';
import { findTrades, type FitOptions, type Trades } from '../fit.js';
import { decibels, errorTogether } from '../measure.js';
import type { Cut, ReducedCloud } from '../reduce.js';
import type { Ranking } from '../score.js';

/** Part of the error of drops and merges that is taken to be left by refining: the search is of cuts that err so much more, and what is really left is measured. */
export const LEFT_BY_REFINING = 0.4;
/** Cuts that are refined, and how near to the figure one must come. */
const TRIES = 4;
const NEAR_ENOUGH = 0.97;
/** From one that fits to one that does not, in parts: what lies between is not worth another. */
const NARROW = 1.03;
/** How the error may grow with the one that is allowed, both as logarithms: what two tries tell beyond it is noise. */
const [LEAST_SLOPE, MOST_SLOPE] = [0.5, 2];

/** How much is cut, and whether what that leaves is refined. */
export interface Plan {
  readonly trades: Trades;
  /** Error that the search allows, in parts of the one that was asked for. */
  readonly filling: number;
  readonly isRefined: boolean;
}

/** A cut, and what it leaves. */
export interface CutCloud {
  readonly cut: Cut;
  readonly reduced: ReducedCloud;
}

/** What came of a filling. */
interface Tried {
  readonly filling: number;
  readonly error: number;
}

/** Makes a cut, and refines what it leaves where that is planned. */
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
 * The largest cut, of a few, that errs no more than is asked once it is refined: neither in the searched views nor in those that are held out, which can only ask for less. None of them was fitted to.
 * @returns undefined if all err more
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

/** The largest that has been found to err no more than is asked (0 if none has), and the smallest that errs more. */
function bracketOf(tried: readonly Tried[], budget: number): [number, number] {
  const fits = Math.max(0, ...tried.filter(({ error }) => error <= budget).map(({ filling }) => filling));
  const fails = Math.min(Infinity, ...tried.filter(({ error }) => error > budget).map(({ filling }) => filling));
  return [fits, fails];
}

/** Where the error should come to what is asked, by the last two tries, and between those that have been found to err less and more. */
function nextFilling(tried: readonly Tried[], budget: number): number {
  const [last, before] = [tried[tried.length - 1], tried[tried.length - 2]];
  const measured = before && Math.log(last.error / before.error) / Math.log(last.filling / before.filling);
  const slope = Math.min(MOST_SLOPE, Math.max(LEAST_SLOPE, measured ?? 1));
  const guess = last.filling * ((0.985 * budget) / last.error) ** (1 / slope);
  const [fits, fails] = bracketOf(tried, budget);
  if (guess > fits && guess < fails) return guess;
  return fits > 0 && fails < Infinity ? Math.sqrt(fits * fails) : fits > 0 ? 1.2 * fits : 0.8 * fails;
}
