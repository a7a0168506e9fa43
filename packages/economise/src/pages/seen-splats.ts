/** Visibility of the splats of a cloud, by their indices in it. */
export interface SplatVisibility {
  /**
   * [N] mean over the views of the sum of a splat's squared weights, as a fraction of the pixels; 0 if no view shows
   * it.
   */
  readonly energies: Float32Array;
  /**
   * [N, n (n + 1) / 2] with n coefficients: the lower triangular root, row-major, of the visibility-weighted mean of Y
   * Yᵀ over the views, with Y the basis functions in the direction of each view. Empty if unknown, and at degree 0.
   */
  readonly roots: Float32Array;
}

/**
 * Minimum energy of a splat, as a fraction of that of an unoccluded one, because hidden splats may be visible from
 * other views.
 */
const MIN_SHARE = 1 / 64;

/**
 * Weight of a color error of each splat.
 * @param usual [N] estimate from opacities and sizes: squared opacities times areas.
 * @param energies [N] of {@link SplatVisibility}.
 * @returns The energies with a lower limit; and the factor that converts estimates to energies.
 */
export function visibilityWeights(
  usual: Float32Array,
  energies: Float32Array,
): { weights: Float32Array; unit: number } {
  const ratios = energies.map((energy, i) => (usual[i] > 0 ? energy / usual[i] : 0)).sort();
  const unit = ratios[ratios.length >> 1] ?? 0;
  return { weights: energies.map((energy, i) => Math.max(energy, MIN_SHARE * unit * usual[i])), unit };
}
