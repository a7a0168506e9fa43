/** Utilities for the rows in Chromium. */

export { sized } from '../../support/extent-in-pages.js';

let state = 18;
/** Numbers in 0..1, the same in every run. */
export const random = (): number => (state = (state * 48271) % 0x7fffffff) / 0x7fffffff;
