/** What the splats of a cloud were seen to contribute. */
export interface Ranking {
  /** [N] largest weight in any pixel of any view, 0..1; 1 for splats that too few views see to judge them. */
  readonly contribution: Float32Array;
  /** [N] the largest mean squared error of any view's image if this splat alone goes, peak 1; Infinity for splats that too few views see. */
  readonly removalError: Float32Array;
}

/** The colours of all splats with fewer bands. */
export interface LoweredColours {
  /** [N] the mean squared error of the views' images if this splat alone has them; Infinity for splats that too few views see. */
  readonly error: Float32Array;
  /** [(degree + 1)², 3] coefficients of splat i: those that come nearest to the colours that the views saw. */
  of(i: number): Float32Array;
}

/** A ranking, and what splats look like with fewer bands of colour. */
export interface Scores extends Ranking {
  /** The colours at each degree below the cloud's. */
  readonly lowered: readonly LoweredColours[];
}

/** A splat that fewer views looked at is kept, with all bands of its colour: another view may show it in full. */
export const MIN_LOOKS = 3;

/**
 * What lies behind a splat differs from it by the root of this, in other views, besides what it does in those that were looked at: much of what goes
 * goes together with what lay behind it, and then something else is seen.
 */
export const UNSEEN_CONTRAST = 0.1;

/** A few views know little of a colour that depends on the view: so many more are imagined, from everywhere. */
export const PRIOR_VIEWS = 4;
