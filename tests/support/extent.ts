import { evenly } from './evenly.js';

/**
 * The extent of tests. `npm test` runs the checks that find different faults, 9 to 14 minutes on two cores; `npm run test:lab` adds what only repeats or widens, and `npm test -- --full` also runs what repeats the
 * same check on more views, formats and sizes.
 */
export const isFull = process.env.TESTS === 'full';

/** For the options of a test that only the full run has. */
export const onlyInFull: string | false = isFull ? false : 'runs in npm test -- --full';

/** Whether the laboratory runs: once a day's work, and before a release. */
export const isLab = isFull || process.env.TESTS === 'lab';

/**
 * Some of the cases of a test, evenly chosen: all of them in the laboratory.
 * @param count how many `npm test` keeps
 */
export function someOf<T>(cases: readonly T[], count: number): readonly T[] {
  return isLab ? cases : evenly(cases, count);
}

/** For the options of a test that the daily run leaves to the laboratory. */
export const onlyInLab: string | false = isLab ? false : 'runs in npm run test:lab';
