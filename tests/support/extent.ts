/**
 * How much is tested. `npm test` keeps to what tells faults apart within its 25 minutes on two cores; `npm test -- --full` also runs what repeats the
 * same check on more views, formats and sizes.
 */
export const isFull = process.env.TESTS === 'full';

/** For the options of a test that only the full run has. */
export const onlyInFull: string | false = isFull ? false : 'runs in npm test -- --full';
