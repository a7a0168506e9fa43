import type { Camera } from '@gaussian-splat/core';

/** The contribution of each splat of a cloud to one image. */
export interface Contributions {
  /** [N] the largest weight, alpha times transmittance in 0..1, in any pixel; 0 for splats that paint nothing. */
  readonly peak: Float32Array;
  /** [N] the sum of the squares of the weights in all pixels, over the number of pixels of the image. */
  readonly energy: Float32Array;
  /** [N] the mean squared error of the image's three colors, peak 1, if this splat alone were missing. */
  readonly removal: Float32Array;
}

/** Measures an image. The caller may keep the arrays until the next call. */
export type ContributionScorer = (camera: Camera) => Contributions | Promise<Contributions>;
