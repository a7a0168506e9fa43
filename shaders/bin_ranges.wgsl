// Where each bin begins and ends among the pairs, once they are sorted by bin.
#import shared/bins
#import shared/plan
#import shared/group

@group(0) @binding(0) var<storage, read> pair_plan: Plan;
// Bins of the sorted pairs.
@group(0) @binding(1) var<storage, read> bins: array<u32>;
// First pair of each bin and the one behind the last; equal where a bin is empty.
@group(0) @binding(2) var<storage, read_write> ranges: array<vec2u>;

@compute @workgroup_size(PROJECT_GROUP)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let i = group_index(workgroup_id) * PROJECT_GROUP + lane;
  if (i >= pair_plan.visible) { return; }
  let bin = bins[i];
  if (i == 0u || bins[i - 1u] != bin) { ranges[bin].x = i; }
  if (i == pair_plan.visible - 1u || bins[i + 1u] != bin) { ranges[bin].y = i + 1u; }
}
