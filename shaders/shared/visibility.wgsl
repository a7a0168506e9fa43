// Whether a splat paints anything.
#import shared/projection
#import shared/stored_gaussian
#import shared/occlusion
#import shared/detail
#import shared/sides

// Depths beyond which nothing shows, of tiles and then of blocks of tiles: see shared/occlusion.
@group(0) @binding(6) var<storage, read> occlusion: array<u32>;

// Of the page, if it was looked at from all sides; else not looked at.
@group(0) @binding(8) var<storage, read> seen_from: array<u32>;

const TWO_PI = 6.283185307179586;

// Tiles, across or down, that are looked at one by one; splats that cover more are judged by blocks, those that cover as many
// blocks are kept.
const LOOKED_AT = 4u;

// True if nothing of the splat can show, because it lies behind what finished the pixels of all its tiles in the last frame.
fn is_occluded(view: View, e: Ellipse) -> bool {
  if (view.occlusion_tiles.x == 0u) { return false; }
  let extent = half_extent(view, e);
  let low = clamp(e.center - extent - 0.5, vec2f(0.0), view.viewport - 1.0);
  let high = clamp(e.center + extent + 0.5, vec2f(0.0), view.viewport - 1.0);
  var first = vec2u(low) / TILE;
  var last = vec2u(high) / TILE;
  var start = 0u;
  var columns = view.occlusion_tiles.x;
  if (any(last - first >= vec2u(LOOKED_AT))) {
    first /= OCCLUSION_BLOCK;
    last /= OCCLUSION_BLOCK;
    if (any(last - first >= vec2u(LOOKED_AT))) { return false; }
    start = view.occlusion_tiles.x * view.occlusion_tiles.y;
    columns = occlusion_blocks(view.occlusion_tiles).x;
  }
  for (var y = first.y; y <= last.y; y++) {
    for (var x = first.x; x <= last.x; x++) {
      if (e.depth <= bitcast<f32>(occlusion[start + y * columns + x])) { return false; }
    }
  }
  return true;
}

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
  if (!contributes || !covers_a_pixel(view, e) || is_occluded(view, e)) { return 0.0; }
  return depth;
}
