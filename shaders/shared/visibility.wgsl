// Whether a splat paints anything.
#import shared/projection

// Splats with less than this opacity times their area in px² are left out. A lever: 0 leaves out none.
override min_contribution: f32 = 0.0;

const TWO_PI = 6.283185307179586;

// Camera depth of a splat that paints something, 0 of any other.
fn visible_depth(packed: PackedGaussian) -> f32 {
  let g = unpack_gaussian(packed);
  // The cheap tests first: most splats of a scene fail one of them.
  let depth = (view.local_to_camera * vec4f(g.position, 1.0)).z;
  if (g.opacity < alpha_min || !is_in_depth_range(view, depth)) { return 0.0; }
  let e = project_ellipse(view, g);
  let contributes = e.opacity * TWO_PI * e.sigma_x * e.sigma_v >= min_contribution;
  return select(0.0, depth, contributes && covers_a_pixel(view, e));
}
