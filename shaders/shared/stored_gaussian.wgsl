// Loads a splat of the current block for the stages before the rasterizer. Blocks with another geometry replace this
// file (shared/quantized_gaussian): scripts/build-shaders.mjs builds both variants of the same stages.
#import shared/packed_gaussian

alias StoredGaussian = PackedGaussian;
alias FoundGaussian = PackedGaussian;

fn gaussian_at(i: u32) -> FoundGaussian {
  return gaussians[i];
}
