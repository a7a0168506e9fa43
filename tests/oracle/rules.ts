/** The numbers on which published rasterizers agree or differ. Everything else in the oracle is the shared method. */

export type RuleSet = 'inria' | 'gsplat';

/** `classic` dilates and keeps the opacity; `antialiased` lowers it by the dilation's addition (Mip-Splatting style). */
export type Mode = 'classic' | 'antialiased';

export interface Rules {
  /** Added to both diagonal elements of the screen covariance, px². */
  readonly dilation: number;
  /** How far beyond the image edge the Jacobian still follows a center, as a fraction of tan(fov / 2). */
  readonly jacobianMargin: number;
  /** Smallest det(Σ) / det(Σ + dilation·I) whose square root scales an antialiased opacity. */
  readonly compensationFloor: number;
  /** A fragment is never more opaque than this, so that gradients can still pass through it. */
  readonly maxAlpha: number;
  /** Fragments fainter than this are skipped. */
  readonly minAlpha: number;
  /** A pixel is finished before a fragment that would take its transmittance below this... */
  readonly minTransmittance: number;
  /** ...or exactly to it. */
  readonly stopsAtEquality: boolean;
  /** True if a center exactly on the near plane is drawn. */
  readonly drawsOnNearPlane: boolean;
  /**
   * Which pixels a splat may reach. `ellipse`: all that pass the alpha test.
   * `tiles`: those in the 16x16 tiles that a circle of 3 standard deviations touches, so the cut depends on the tile grid.
   */
  readonly footprint: 'ellipse' | 'tiles';
}

export const RULES: Record<RuleSet, Rules> = {
  /** diff-gaussian-rasterization 59f5f77 (2023), which published scenes are trained with. Its compensation came later. */
  inria: {
    dilation: 0.3,
    jacobianMargin: 0.3,
    compensationFloor: 0.005 ** 2,
    maxAlpha: 0.99,
    minAlpha: 1 / 255,
    minTransmittance: 1e-4,
    stopsAtEquality: false,
    drawsOnNearPlane: false,
    footprint: 'tiles',
  },
  /**
   * gsplat 1.5.3 (2025), which made the reference images. They show its cap of 0.999: with 0.99, INRIA's and later gsplat's,
   * the worst pixel is off by 3.6/255 instead of 1.3/255. They do not distinguish its missing compensation floor from that of INRIA and later gsplat, which is used here.
   *
   * Its screen rectangle, min(3.33, sqrt(2·ln(255·opacity))) standard deviations along each axis, is exactly the box around
   * the pixels that pass the alpha test (sqrt(2·ln 255) = 3.329), so it does not cut anything on its own.
   */
  gsplat: {
    dilation: 0.3,
    jacobianMargin: 0.3,
    compensationFloor: 0.005 ** 2,
    maxAlpha: 0.999,
    minAlpha: 1 / 255,
    minTransmittance: 1e-4,
    stopsAtEquality: true,
    drawsOnNearPlane: true,
    footprint: 'ellipse',
  },
};
