// Finds the densest depths of splats along the rays of points: one fragment for each pair of splat and probed point.
#import shared/densest
#import shared/stored_gaussian
#import shared/full_screen

@group(0) @binding(0) var<uniform> view: View;

@group(0) @binding(2) var order: texture_2d<u32>;
// x and y of a pixel, as the bits of float32, and the rank of a splat.
@group(0) @binding(3) var asked: texture_2d<u32>;

@fragment
fn fragment(@builtin(position) position: vec4f) -> @location(0) vec4u {
  let question = textureLoad(asked, vec2u(u32(position.x), 0u), 0);
  let i = textureLoad(order, texel_of(question.z), 0).x;
  let depth = surface_depth(view, unpack_gaussian(gaussian_at(i)), bitcast<vec2f>(question.xy));
  return vec4u(bitcast<u32>(depth), i, 0u, 0u);
}
