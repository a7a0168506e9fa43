/** Visibility of the splats of a cloud in views. */
export interface SplatVisibility {
  /**
   * [N] mean, over the views, of the sum of a splat's squared weights divided by the number of pixels. 0 if no view shows
   * the splat.
   */
  readonly energies: Float32Array;
  /**
   * [N, n (n + 1) / 2] for n coefficients of a channel: row-major lower triangular roots of the mean of Y Yᵀ over the
   * views, weighted by energy. Y are the basis functions in the direction of a view. Empty if unknown, and at degree 0.
   */
  readonly roots: Float32Array;
}

/**
 * Minimum energy of a splat, as a fraction of the energy without occlusion, because hidden splats may be visible in other
 * views.
 */
const MIN_SHARE = 1 / 64;

/**
 * Returns the weight of the squared color error of each splat.
 * @param usual [N] estimates from opacities and sizes: squared opacities times areas.
 * @param energies [N] energies as in {@link SplatVisibility}.
 * @returns `weights`: energies with a lower limit, [N]. `unit`: factor that converts estimates to energies.
 */
export function visibilityWeights(
  usual: Float32Array,
  energies: Float32Array,
): { weights: Float32Array; unit: number } {
  const ratios = energies.map((energy, i) => (usual[i] > 0 ? energy / usual[i] : 0)).sort();
  const unit = ratios[ratios.length >> 1] ?? 0;
  return { weights: energies.map((energy, i) => Math.max(energy, MIN_SHARE * unit * usual[i])), unit };
}
