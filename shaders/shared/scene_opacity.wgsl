// Opacity of a whole scene. Layers multiply, so half of each splat's opacity would leave a surface of many splats
// opaque. Instead the optical depth of each splat, integrated over its Gaussian, is multiplied by a factor, so that the
// transmittance of a surface is raised to a power.
#import shared/falloff

// For u = -ln(1 - opacity) the integral over a Gaussian is proportional to the dilogarithm of the opacity, here
// DILOGARITHM_1 * (1 - exp(-(u / DILOGARITHM_1 + CURVATURE * u * u))), which is accurate to 0.004 and has a closed
// inverse.
const DILOGARITHM_1 = 1.6449341;
const CURVATURE = 0.0328;

fn thinned_opacity(opacity: f32, factor: f32) -> f32 {
  if (factor >= 1.0) { return opacity; }
  let u = -log(1.0 - clamp(opacity, 0.0, ALPHA_MAX));
  let share = factor * (1.0 - exp(-u * (1.0 / DILOGARITHM_1 + CURVATURE * u)));
  // This form of the root does not cancel for small values.
  let q = -log(1.0 - share);
  let thin = 2.0 * q / (1.0 / DILOGARITHM_1 + sqrt(1.0 / (DILOGARITHM_1 * DILOGARITHM_1) + 4.0 * CURVATURE * q));
  return 1.0 - exp(-thin);
}
