/** An automatic motion of the camera, frame by frame. */
export interface Mover {
  /**
   * Advances to the time of a frame.
   * @param now requestAnimationFrame's clock, ms.
   * @returns Whether another frame is needed.
   */
  advance(now: number): boolean;
}

/** Longest step of such a motion, ms: after a pause it continues from its last state. */
export const MAX_MOVER_STEP_MS = 100;

/** Whether the visitor's system requests reduced motion. */
export const prefersReducedMotion = (): boolean => reducedMotion().matches;

/** The media query of reduced motion, for listeners; documents of unit tests (jsdom) do not support it. */
export const reducedMotion = (): MediaQueryList =>
  globalThis.matchMedia?.('(prefers-reduced-motion: reduce)') ?? new EventTarget();
