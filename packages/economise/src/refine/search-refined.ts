import type { Evaluator } from '../evaluator.js';
import type { FitOptions, Trades } from '../fit.js';
import { decibels, mean } from '../measure.js';
import type { Cut, ReducedCloud } from '../reduce.js';

/** Part of the error of drops and merges that is taken to be left by refining: the search is of cuts that err so much more, and what is really left is measured. */
export const LEFT_BY_REFINING = 0.4;
/** Cuts that are refined, and how near to the figure one must come. */
const TRIES = 4;
const NEAR_ENOUGH = 0.97;
/** How the error may grow with the one that is allowed, both as logarithms: what two tries tell beyond it is noise. */
const [LEAST_SLOPE, MOST_SLOPE] = [0.5, 2];

/** A cut, and what it leaves once that is refined. */
export interface RefinedCut {
  readonly cut: Cut;
  readonly reduced: ReducedCloud;
  /** Error that the search allowed, in parts of the one that was asked for. */
  readonly filling: number;
}

/** Makes a cut that the search allows so much error, and refines what it leaves. */
export async function refinedCut(
  { cutAt }: Trades,
  evaluator: Evaluator,
  budget: number,
  filling: number,
  signal: AbortSignal | undefined,
): Promise<RefinedCut> {
  const cut = cutAt(filling * budget);
  const reduced = await evaluator.reduce(cut, signal);
  return { cut, filling, reduced: (await evaluator.refine?.(reduced, signal)) ?? reduced };
}

/**
 * The largest cut, of a few, that errs no more than is asked once it is refined: neither in the searched views nor in those that are held out, which can only ask for less. None of them was fitted to.
 * @returns the smallest that was tried, if all err more
 */
export async function searchRefined(
  trades: Trades,
  evaluator: Evaluator,
  budget: number,
  { signal, onStep = () => undefined }: FitOptions,
): Promise<RefinedCut> {
  const tried: { readonly filling: number; readonly error: number }[] = [];
  let best: RefinedCut | undefined;
  let least: RefinedCut | undefined;
  let next = 1;
  for (let tries = 0; tries < TRIES; tries++) {
    onStep(`refining what ${next.toFixed(2)} of the expected error allows`);
    const found = await refinedCut(trades, evaluator, budget, next, signal);
    const errors: number[] = [];
    for (const views of ['searched', 'heldOut'] as const)
      errors.push(mean(await evaluator.sketch(found.reduced.cloud, views, signal)));
    const error = Math.max(...errors);
    onStep(`refined: ${decibels(error).toFixed(2)} dB, ${found.reduced.cloud.count} splats`);
    tried.push({ filling: next, error });
    if (error <= budget && next > (best?.filling ?? 0)) best = found;
    if (next < (least?.filling ?? Infinity)) least = found;
    if (error <= budget && error > NEAR_ENOUGH * budget) break;
    next = nextFilling(tried, budget);
    if (tried.some(({ filling }) => filling === next)) break;
  }
  return (best ?? least)!;
}

/** Where the error should come to what is asked, by the last two tries, and between those that have been found to err less and more. */
function nextFilling(tried: readonly { filling: number; error: number }[], budget: number): number {
  const [last, before] = [tried[tried.length - 1], tried[tried.length - 2]];
  const measured = before && Math.log(last.error / before.error) / Math.log(last.filling / before.filling);
  const slope = Math.min(MOST_SLOPE, Math.max(LEAST_SLOPE, measured ?? 1));
  const guess = last.filling * ((0.985 * budget) / last.error) ** (1 / slope);
  const fits = Math.max(0, ...tried.filter(({ error }) => error <= budget).map(({ filling }) => filling));
  const fails = Math.min(Infinity, ...tried.filter(({ error }) => error > budget).map(({ filling }) => filling));
  if (guess > fits && guess < fails) return guess;
  return fits > 0 && fails < Infinity ? Math.sqrt(fits * fails) : fits > 0 ? 1.2 * fits : 0.8 * fails;
}
