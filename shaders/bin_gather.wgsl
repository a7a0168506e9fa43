// Lays the pairs out bin by bin, still in depth order, and notes where each bin begins and ends.
#import shared/bins
#import shared/plan
#import shared/group

@group(0) @binding(0) var<storage, read> pair_plan: PlanView;
// Bins of the sorted pairs, and the places of the pairs before the sort.
@group(0) @binding(1) var<storage, read> bins: array<u32>;
@group(0) @binding(2) var<storage, read> places: array<u32>;
@group(0) @binding(3) var<storage, read> pairs: array<BinPair>;
@group(0) @binding(4) var<storage, read_write> sorted_pairs: array<BinPair>;
// First pair of each bin and the one behind the last; equal where a bin is empty.
@group(0) @binding(5) var<storage, read_write> ranges: array<vec2u>;

@compute @workgroup_size(PROJECT_GROUP)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let i = group_index(workgroup_id) * PROJECT_GROUP + lane;
  if (i >= pair_plan.visible) { return; }
  sorted_pairs[i] = pairs[places[i]];
  let bin = bins[i];
  if (i == 0u || bins[i - 1u] != bin) { ranges[bin].x = i; }
  if (i == pair_plan.visible - 1u || bins[i + 1u] != bin) { ranges[bin].y = i + 1u; }
}
