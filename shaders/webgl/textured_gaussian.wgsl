// Replaces shared/stored_gaussian: two texels for each splat.
#import shared/packed_gaussian
#import webgl/texels

alias FoundGaussian = PackedGaussian;

@group(0) @binding(1) var geometry: texture_2d<u32>;

fn gaussian_at(i: u32) -> FoundGaussian {
  return PackedGaussian(textureLoad(geometry, texel_of(2u * i), 0), textureLoad(geometry, texel_of(2u * i + 1u), 0));
}
