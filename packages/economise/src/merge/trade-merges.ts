import type { CutFigures, Evaluator } from '../evaluator.js';
import type { Trades } from '../fit.js';
import { mean } from '../measure.js';
import type { Cut } from '../reduce.js';
import type { TradeCurve } from '../search.js';

/** Shares of the error that are tried for merges. */
const MERGE_SHARES = [0, 0.25, 0.5, 0.75, 0.9, 1];
/** Cuts that are tried for each of them, until one comes near the error that is allowed. */
const TRIES = 3;
const NEAR_ENOUGH = 0.97;

/**
 * How much of the error should go to merges, and how much to the rest. Splats that are dropped and splats that are merged are often the same ones, so that what both save together is measured, in the searched
 * views, and not added up.
 * @param saved numbers of the file that a cut saves
 */
export async function tradeMerges(
  others: Trades,
  merge: TradeCurve,
  evaluator: Evaluator,
  budget: number,
  saved: (figures: CutFigures) => number,
  signal: AbortSignal | undefined,
): Promise<Trades> {
  let [best, most] = [others, -1];
  for (const share of MERGE_SHARES) {
    const cutAt = (error: number): Cut => ({
      ...others.cutAt((1 - share) * error),
      mergePrice: merge.within(share * error).threshold,
    });
    let [fits, fails, next] = [0, Infinity, 1];
    for (let tries = 0; tries < TRIES; tries++) {
      const figures = await evaluator.cut(cutAt(next * budget), 'searched', signal);
      const error = mean(figures.errors);
      if (error <= budget) {
        fits = next;
        if (saved(figures) > most) [best, most] = [{ cutAt: scaled(cutAt, next) }, saved(figures)];
        if (error > NEAR_ENOUGH * budget) break;
      } else fails = next;
      const guess = error > 0 ? (next * 0.99 * budget) / error : 2 * next;
      next = guess > fits && guess < fails ? guess : fails < Infinity ? (fits + fails) / 2 : 2 * fits;
    }
  }
  return best;
}

const scaled =
  (cutAt: (error: number) => Cut, scale: number) =>
  (error: number): Cut =>
    cutAt(scale * error);
