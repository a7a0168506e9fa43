// Whether a splat paints anything.
#import shared/projection
#import shared/stored_gaussian
#import shared/detail
#import shared/scene_opacity

struct Visible {
  // In the camera's frame; 0 of a splat that paints nothing.
  depth: f32,
  // Share of the image, in SHARE_UNITs.
  covered: u32,
}

// What a splat paints when it is drawn to a share.
fn visible_part(found: FoundGaussian, share: f32) -> Visible {
  var g = unpack_gaussian(found);
  g.opacity = shared_opacity(thinned_opacity(g.opacity, view.opacity), share);
  // The cheap tests first: most splats of a scene fail one of them.
  let depth = in_camera(view, g.position).z;
  if (any(g.position < view.crop_low) || any(g.position > view.crop_high)) { return Visible(0.0, 0u); }
  if (g.opacity < ALPHA_MIN || !is_in_depth_range(view, depth)) { return Visible(0.0, 0u); }
  let e = project_ellipse(view, g);
  let box = covered_box(view, e);
  if (box.x <= 0.0) { return Visible(0.0, 0u); }
  return Visible(depth, covered_share(view, e, box));
}
