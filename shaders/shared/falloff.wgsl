// Opacity of a splat by the distance from its center, with the constants of training.

// Minimum alpha with which a splat contributes to a pixel, as in training.
const ALPHA_MIN = 1.0 / 255.0;
// Maximum alpha of a splat: the limit of gsplat. INRIA's 0.99 does not match the reference images.
const ALPHA_MAX = 0.999;

// Distance from the center, in standard deviations, at which alpha falls to ALPHA_MIN; 0 for opacities up to ALPHA_MIN.
fn cutoff_radius(opacity: f32) -> f32 {
  return sqrt(2.0 * log(max(opacity / ALPHA_MIN, 1.0)));
}

// Alpha of a splat at an offset from its center, in pixels: opacity · exp(-(u² + v²) / 2), at most ALPHA_MAX.
fn alpha_at(offset: vec2f, inverse_sigma_x: f32, slope: f32, inverse_sigma_v: f32, opacity: f32) -> f32 {
  let u = offset.x * inverse_sigma_x;
  let v = (offset.y - slope * offset.x) * inverse_sigma_v;
  return min(ALPHA_MAX, opacity * exp(-0.5 * (u * u + v * v)));
}
