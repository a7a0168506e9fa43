/** How much is tested in Chromium: see `extent.ts`. web-test-runner.config.mjs says it to the pages. */
import { evenly } from './evenly.js';

export const isFull = (globalThis as { STABILITY?: string }).STABILITY === 'full';

/** Whether the laboratory's breadth is tested: `npm run test:lab`. */
export const isLab = isFull || ['lab', 'full'].includes((globalThis as { TESTS?: string }).TESTS ?? '');

/** A test of the laboratory's: one that a clock judges, or that only widens another. */
export const itInLab = isLab ? it : it.skip;

/** One of two sizes of a test: a part of it in `npm test`, all of it in `npm test -- --full` and `npm run lab -- stability`. */
export const sized = <T>(fast: T, full: T): T => (isFull ? full : fast);

/**
 * Some of the cases of a test, evenly chosen: all of them in the laboratory.
 * @param count how many `npm test` keeps
 */
export function someOf<T>(cases: readonly T[], count: number): readonly T[] {
  return isLab ? cases : evenly(cases, count);
}
