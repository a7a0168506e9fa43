// Copies the coefficients of a lower degree of some splats of a block into a dense list, because `lowered` holds all
// degrees and is as large as the scene.
#import shared/group
#import shared/score

struct Take {
  // Numbers copied for all splats together, and for each splat.
  count: u32,
  width: u32,
  sh_degree: u32,
  degree: u32,
}

@group(0) @binding(0) var<uniform> take: Take;
// Indices of the splats within the block.
@group(0) @binding(1) var<storage, read> splats: array<u32>;
// See optimize_lower.
@group(0) @binding(2) var<storage, read> lowered: array<f32>;
@group(0) @binding(3) var<storage, read_write> taken: array<f32>;

@compute @workgroup_size(SCORE_GROUP)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let n = group_index(workgroup_id) * SCORE_GROUP + lane;
  if (n >= take.count) { return; }
  let record = splats[n / take.width] * lowered_numbers(take.sh_degree, take.sh_degree);
  taken[n] = lowered[record + lowered_numbers(take.sh_degree, take.degree) + n % take.width];
}
