// Finds the densest depths of splats along the rays of points: one fragment for each point and fraction of the light. The last
// row of ranges is copied. Splats of other scenes are left to their own draws.
#import shared/densest
#import shared/stored_gaussian
#import webgl/probe_range
#import shared/full_screen

@group(0) @binding(0) var<uniform> view: View;

@group(0) @binding(2) var order: texture_2d<u32>;
// x and y of a pixel, as the bits of float32: one texel for each point.
@group(0) @binding(3) var asked: texture_2d<u32>;
// Ranges of one splat: see `probe_cross`.
@group(0) @binding(4) var ranges: texture_2d<u32>;

@fragment
fn fragment(@builtin(position) position: vec4f) -> @location(0) vec4u {
  let place = vec2u(position.xy);
  let found = textureLoad(ranges, place, 0);
  let range = range_of(found);
  if (place.y + 1u == textureDimensions(ranges).y) { return found; }
  if (range.first == range.end) { return vec4u(0u); }
  let question = bitcast<vec4f>(textureLoad(asked, vec2u(place.x, 0u), 0));
  let i = textureLoad(order, texel_of(range.first), 0).x - view.first_group * DATA_WIDTH;
  if (i >= view.splat_count) { discard; }
  let surface = surface_at(view, unpack_gaussian(gaussian_at(i)), question.xy);
  return vec4u(bitcast<u32>(surface.depth), i, view.page + 1u, bitcast<u32>(surface.thickness));
}
