// Whether a splat paints anything.
#import shared/projection
#import shared/stored_gaussian
#import shared/detail
#import shared/sides

// Of the page, if it was looked at from all sides; else not looked at.
@group(0) @binding(6) var<storage, read> seen_from: array<u32>;

const TWO_PI = 6.283185307179586;

// True if the splat showed from none of the sides that are near the camera's.
fn is_turned_away(view: View, splat: u32) -> bool {
  if (all(view.sides == vec4u(0u))) { return false; }
  var matching = 0u;
  // Sides that are near one another share a word or two.
  for (var word = 0u; word < SIDE_WORDS; word++) {
    if (view.sides[word] != 0u) { matching |= view.sides[word] & seen_from[side_word(arrayLength(&seen_from), word, splat)]; }
  }
  return matching == 0u;
}

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
