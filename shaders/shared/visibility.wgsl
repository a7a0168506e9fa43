// Whether a splat paints anything.
#import shared/projection
#import shared/stored_gaussian
#import shared/detail

const TWO_PI = 6.283185307179586;

// Camera depth of a splat that paints something when it is drawn to a share, 0 of any other.
fn visible_depth(found: FoundGaussian, share: f32) -> f32 {
  var g = unpack_gaussian(found);
  g.opacity = shared_opacity(g.opacity, share);
  // The cheap tests first: most splats of a scene fail one of them.
  let depth = in_camera(view, g.position).z;
  if (g.opacity < view.alpha_min || !is_in_depth_range(view, depth)) { return 0.0; }
  let e = project_ellipse(view, g);
  let contributes = e.opacity * TWO_PI * e.sigma_x * e.sigma_v >= view.min_contribution;
  if (!contributes || !covers_a_pixel(view, e)) { return 0.0; }
  return depth;
}
