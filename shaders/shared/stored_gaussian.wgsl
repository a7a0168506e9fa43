// How the stages before the rasterizer find a splat of the page at hand. Pages of another geometry have another file in place of this one
// (shared/quantized_gaussian): scripts/build-shaders.mjs makes both of the same stages.
#import shared/packed_gaussian

alias StoredGaussian = PackedGaussian;
alias FoundGaussian = PackedGaussian;

fn gaussian_at(i: u32) -> FoundGaussian {
  return gaussians[i];
}
