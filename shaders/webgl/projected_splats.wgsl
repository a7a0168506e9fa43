// The projected splats, and their indices from near to far.
#import shared/splat
#import webgl/texels

@group(0) @binding(1) var shapes: texture_2d<u32>;
@group(0) @binding(2) var paints: texture_2d<u32>;
@group(0) @binding(3) var order: texture_2d<u32>;

fn splat_at(rank: u32) -> ProjectedSplat {
  let place = texel_of(textureLoad(order, texel_of(rank), 0).x);
  return ProjectedSplat(bitcast<vec4f>(textureLoad(shapes, place, 0)), textureLoad(paints, place, 0));
}
