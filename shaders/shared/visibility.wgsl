// Whether a splat paints anything.
#import shared/projection
#import shared/stored_gaussian
#import shared/detail
#import shared/scene_opacity

// Camera depth of a splat that paints something when it is drawn to a share, 0 of any other.
fn visible_depth(found: FoundGaussian, share: f32) -> f32 {
  var g = unpack_gaussian(found);
  g.opacity = shared_opacity(thinned_opacity(g.opacity, view.opacity), share);
  // The cheap tests first: most splats of a scene fail one of them.
  let depth = in_camera(view, g.position).z;
  if (any(g.position < view.crop_low) || any(g.position > view.crop_high)) { return 0.0; }
  if (g.opacity < ALPHA_MIN || !is_in_depth_range(view, depth)) { return 0.0; }
  let e = project_ellipse(view, g);
  return select(0.0, depth, covers_a_pixel(view, e));
}
