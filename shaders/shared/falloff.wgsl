// How opaque a splat is at a distance from its centre: the rules that scenes are trained with.

// A splat paints a pixel only with an alpha of at least this: what scenes are trained with.
const ALPHA_MIN = 1.0 / 255.0;
// No splat is more opaque than this: gsplat's limit. INRIA's is 0.99, which the reference images refuse.
const ALPHA_MAX = 0.999;

// Distance from the centre, in standard deviations, at which alpha falls to ALPHA_MIN. 0 for opacities up to that.
fn cutoff_radius(opacity: f32) -> f32 {
  return sqrt(2.0 * log(max(opacity / ALPHA_MIN, 1.0)));
}

// Alpha of a splat at an offset from its centre, in pixels: opacity · exp(-(u² + v²) / 2), at most ALPHA_MAX.
fn alpha_at(offset: vec2f, inverse_sigma_x: f32, slope: f32, inverse_sigma_v: f32, opacity: f32) -> f32 {
  let u = offset.x * inverse_sigma_x;
  let v = (offset.y - slope * offset.x) * inverse_sigma_v;
  return min(ALPHA_MAX, opacity * exp(-0.5 * (u * u + v * v)));
}
