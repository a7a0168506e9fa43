// Tests whether a splat contributes to the image.
#import shared/projection
#import shared/stored_gaussian
#import shared/detail
#import shared/scene_opacity

struct Visible {
  // Camera depth; 0 if the splat is invisible.
  depth: f32,
  // Fraction of the image, in SHARE_UNITs.
  covered: u32,
}

// Depth and coverage of a splat drawn with a weight.
fn visible_part(found: FoundGaussian, share: f32) -> Visible {
  var g = unpack_gaussian(found);
  g.opacity = shared_opacity(thinned_opacity(g.opacity, view.opacity), share);
  // The cheap tests come first, because most splats of a scene fail one of them.
  let depth = in_camera(view, g.position).z;
  if (any(g.position < view.crop_low) || any(g.position > view.crop_high)) { return Visible(0.0, 0u); }
  if (g.opacity < ALPHA_MIN || !is_in_depth_range(view, depth)) { return Visible(0.0, 0u); }
  let e = project_ellipse(view, g);
  let box = covered_box(view, e);
  if (box.x <= 0.0) { return Visible(0.0, 0u); }
  return Visible(depth, covered_share(view, e, box));
}
