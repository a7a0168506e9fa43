/** How views see the splats of a cloud, by their numbers in it. */
export interface SeenSplats {
  /** [N] mean over the views of the sum of the squares of a splat's weights, as a share of the pixels; 0 where no view sees it. */
  readonly energies: Float32Array;
  /**
   * [N, n (n + 1) / 2] with n coefficients: the lower triangular root, rows outermost, of the mean of Y Yᵀ over what the views see of a splat, with Y the basis functions in the direction of each view. Empty where that is not known, and at degree 0.
   */
  readonly roots: Float32Array;
}

/** What no view shows of a splat may still be seen from elsewhere: its share of the energy that it would have in plain sight. */
const LEAST_SHARE = 1 / 64;

/**
 * How much an error of each splat's colour counts.
 * @param usual [N] what opacities and sizes tell of it: squares of opacities, times areas
 * @param energies [N] of {@link SeenSplats}
 * @returns the energies, none of them too small; and what a usual number has to be multiplied by to be compared with them
 */
export function weighSplats(usual: Float32Array, energies: Float32Array): { weights: Float32Array; unit: number } {
  const ratios = energies.map((energy, i) => (usual[i] > 0 ? energy / usual[i] : 0)).sort();
  const unit = ratios[ratios.length >> 1] ?? 0;
  return { weights: energies.map((energy, i) => Math.max(energy, LEAST_SHARE * unit * usual[i])), unit };
}
