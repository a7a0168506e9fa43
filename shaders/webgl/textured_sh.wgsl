// In place of shared/stored_sh: a texel of two words each.
#import webgl/texels

@group(0) @binding(2) var harmonics: texture_2d<u32>;

fn sh_word(i: u32) -> vec2u {
  return textureLoad(harmonics, texel_of(i), 0).xy;
}
