/** What the rows in Chromium share. */

/** Set by web-test-runner.config.mjs under `npm run stability`. */
const isFull = (globalThis as { STABILITY?: string }).STABILITY === 'full';

/** One of two sizes of a recipe: a part of it in `npm test`, all of it under `npm run stability`. */
export const sized = <T>(fast: T, full: T): T => (isFull ? full : fast);

let state = 18;
/** Numbers in 0..1, the same in every run. */
export const random = (): number => (state = (state * 48271) % 0x7fffffff) / 0x7fffffff;
