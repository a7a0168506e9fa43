/** Contribution of the splats of a cloud in the views. */
export interface Ranking {
  /** [N] maximum weight of each splat in any pixel of any view, 0..1; 1 if fewer than {@link MIN_LOOKS} views contain it. */
  readonly contribution: Float32Array;
  /**
   * [N] maximum mean squared error of any view's image if only this splat is removed, peak 1. Infinity if fewer than
   * {@link MIN_LOOKS} views contain the splat.
   */
  readonly removalError: Float32Array;
}

/** Colors of all splats at a lower degree. */
export interface ReducedSh {
  /**
   * [N] mean squared error of the views' images if only this splat has the lower degree, peak 1. Infinity if fewer than
   * {@link MIN_LOOKS} views contain the splat.
   */
  readonly error: Float32Array;
  /** Returns the coefficients of splat `i`, [(degree + 1)², 3]: the least-squares fit to its colors in the views. */
  of(i: number): Float32Array;
}

/** A ranking, and the colors of all splats at lower degrees. */
export interface Scores extends Ranking {
  /** Colors at each degree below that of the cloud; the index is the degree. */
  readonly lowered: readonly ReducedSh[];
}

/**
 * Minimum number of views that must contain a splat for its score. A splat in fewer views is kept with all bands of color,
 * because other views may show it.
 */
export const MIN_LOOKS = 3;

/**
 * Assumed squared contrast between a splat and its background, peak 1, in addition to that in the scoring views. Splats
 * are often removed together with the splats behind them, which reveals other colors.
 */
export const UNSEEN_CONTRAST = 0.1;

/** Number of hypothetical views from all directions in fits of color, because a few views determine colors weakly. */
export const PRIOR_VIEWS = 4;
