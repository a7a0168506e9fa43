/** Longest step of an automatic motion, ms. After a pause the motion therefore continues near its last state. */
export const MAX_MOVER_STEP_MS = 100;

/** Whether the visitor's system requests reduced motion. */
export const prefersReducedMotion = (): boolean => reducedMotion().matches;

/**
 * Returns the media query of reduced motion, to which listeners can be added. Documents of unit tests (jsdom) do not
 * support media queries: there the result never changes.
 */
export const reducedMotion = (): MediaQueryList =>
  globalThis.matchMedia?.('(prefers-reduced-motion: reduce)') ?? new EventTarget();
