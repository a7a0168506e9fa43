/** Something that moves the camera by itself, frame by frame. */
export interface Mover {
  /**
   * Moves on to the moment of a frame.
   * @param now requestAnimationFrame's clock, ms.
   * @returns whether it wants another frame.
   */
  advance(now: number): boolean;
}

/** Longest step of such a motion, ms: after a pause of the picture it goes on from where it was. */
export const MAX_MOVER_STEP_MS = 100;

/** True for people who have asked their system for less motion. */
export const prefersReducedMotion = (): boolean => reducedMotion().matches;

/** The system's wish for less motion, for those who want to know when it comes or goes; documents of unit tests (jsdom) know of none. */
export const reducedMotion = (): MediaQueryList =>
  globalThis.matchMedia?.('(prefers-reduced-motion: reduce)') ?? new EventTarget();
