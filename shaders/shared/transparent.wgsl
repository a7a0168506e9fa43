// Splats that are left out of a scene stay where they are.
#import shared/packed_gaussian

// A Gaussian with opacity 0, which is culled: the bits that `shape_words` takes for the opacity are cleared.
fn transparent(g: PackedGaussian) -> PackedGaussian {
  return PackedGaussian(g.head, g.tail & vec4u(0xffffffffu, ~0xffu, ~0x3ffu, ~0x3ffu));
}
