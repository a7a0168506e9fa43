// Removed splats keep their place.
#import shared/packed_gaussian

// A Gaussian with opacity 0, which is culled: clears the bits that `shape_words` reads as the opacity.
fn transparent(g: PackedGaussian) -> PackedGaussian {
  return PackedGaussian(g.head, g.tail & vec4u(0xffffffffu, ~0xffu, ~0x3ffu, ~0x3ffu));
}
