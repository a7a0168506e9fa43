/** Contribution of the splats of a cloud in the views. */
export interface Ranking {
  /** [N] largest weight in any pixel of any view, 0..1; 1 for splats that too few views contain. */
  readonly contribution: Float32Array;
  /**
   * [N] the largest mean squared error of any view's image from removing only this splat, peak 1; Infinity for splats
   * that too few views contain.
   */
  readonly removalError: Float32Array;
}

/** Colors of all splats at a lower degree. */
export interface ReducedSh {
  /**
   * [N] mean squared error of the views' images from this change of a single splat; Infinity for splats that too few
   * views contain.
   */
  readonly error: Float32Array;
  /** [(degree + 1)², 3] coefficients of splat i: the least-squares fit to the colors in the views. */
  of(i: number): Float32Array;
}

/** A ranking, and the colors with fewer bands. */
export interface Scores extends Ranking {
  /** The colors at each degree below the cloud's. */
  readonly lowered: readonly ReducedSh[];
}

/**
 * Minimum number of views that must contain a splat; otherwise it is kept with all color bands, because another view
 * may show it in full.
 */
export const MIN_LOOKS = 3;

/**
 * Assumed squared contrast between a splat and its background in other views, in addition to that in the scoring views:
 * splats are often removed together with those behind them, which reveals other colors.
 */
export const UNSEEN_CONTRAST = 0.1;

/** Number of imagined views from all directions, because a few views constrain a view-dependent color weakly. */
export const PRIOR_VIEWS = 4;
