// Leaves splats out of a page: those without a bit become transparent.
#import shared/transparent
#import shared/group
#import shared/score

struct Mask {
  splat_count: u32,
  // Number of the page's first splat among all.
  first: u32,
}

@group(0) @binding(0) var<uniform> mask: Mask;
@group(0) @binding(1) var<storage, read> gaussians: array<PackedGaussian>;
// A bit for each splat of the scene.
@group(0) @binding(2) var<storage, read> kept: array<u32>;
@group(0) @binding(3) var<storage, read_write> masked: array<PackedGaussian>;

@compute @workgroup_size(SCORE_GROUP)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let i = group_index(workgroup_id) * SCORE_GROUP + lane;
  if (i >= mask.splat_count) { return; }
  let number = mask.first + i;
  let is_kept = ((kept[number / 32u] >> (number % 32u)) & 1u) != 0u;
  masked[i] = gaussians[i];
  if (!is_kept) { masked[i] = transparent(gaussians[i]); }
}
