import type { Trades } from '../fit.js';
import type { Cut } from '../reduce.js';
import type { TradeCurve } from '../search.js';

/** Mean squared error of a cut, and the count of numbers that it saves in the file. */
export interface MeasuredCut {
  readonly error: number;
  readonly saved: number;
}

/** Fractions of the allowed error that are tried for merges. */
const MERGE_SHARES = [0, 0.25, 0.5, 0.75, 0.9, 1];
/** Maximum number of cuts that are tried for each fraction, until the error is near the limit. */
const TRIES = 3;
const NEAR_ENOUGH = 0.97;

/**
 * Finds the division of the allowed error between merges and other cuts that saves the most. Dropped and merged splats are
 * often the same, so that their combined saving is measured instead of added.
 * @param budget Allowed mean squared error.
 * @param measure Measures a cut in the searched views.
 */
export async function tradeMerges(
  others: Trades,
  merge: TradeCurve,
  budget: number,
  measure: (cut: Cut) => Promise<MeasuredCut>,
): Promise<Trades> {
  let [best, max] = [others, -1];
  for (const share of MERGE_SHARES) {
    const cutAt = (error: number): Cut => ({
      ...others.cutAt((1 - share) * error),
      mergePrice: merge.within(share * error).threshold,
    });
    let [fits, fails, next] = [0, Infinity, 1];
    for (let tries = 0; tries < TRIES; tries++) {
      const { error, saved } = await measure(cutAt(next * budget));
      if (error <= budget) {
        fits = next;
        if (saved > max) [best, max] = [{ cutAt: scaled(cutAt, next) }, saved];
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
