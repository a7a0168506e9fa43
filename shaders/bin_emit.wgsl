// Writes the pairs of splat and bin, in depth order. The threads of a group divide its pairs evenly, so that one huge
// splat does not delay the others.
#import shared/bins
#import shared/plan
#import shared/group
#import shared/prefix

@group(0) @binding(0) var<uniform> view: BinView;
@group(0) @binding(1) var<storage, read> plan: Plan;
@group(0) @binding(2) var<storage, read> order: array<u32>;
@group(0) @binding(3) var<storage, read> rects: array<u32>;
// Exclusive prefix sums over the groups.
@group(0) @binding(4) var<storage, read> group_pairs: array<u32>;
// Bin of each pair: the key of the sort.
@group(0) @binding(5) var<storage, read_write> bins: array<u32>;
// Slot of each pair.
@group(0) @binding(6) var<storage, read_write> pairs: array<u32>;

// Inclusive prefix sums of the pairs of each splat of the group.
var<workgroup> ends: array<u32, PREFIX_THREADS>;

// The splat of the group that owns pair number p: the first with a prefix sum above p.
fn owner_of(p: u32) -> u32 {
  var low = 0u;
  for (var step = PREFIX_THREADS / 2u; step > 0u; step /= 2u) {
    if (ends[low + step - 1u] <= p) { low += step; }
  }
  return low;
}

@compute @workgroup_size(PREFIX_THREADS)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let group = group_index(workgroup_id);
  let first_rank = group * PREFIX_THREADS;
  if (first_rank >= plan.visible) { return; }
  var own = 0u;
  if (first_rank + lane < plan.visible) {
    let rect = rects[first_rank + lane];
    own = ((rect >> 16u) & 255u) * (rect >> 24u);
  }
  ends[lane] = inclusive_sum(own, lane, PREFIX_THREADS);
  workgroupBarrier();
  let base = group_pairs[group];
  let total = min(ends[PREFIX_THREADS - 1u], view.pair_capacity - min(base, view.pair_capacity));
  for (var p = lane; p < total; p += PREFIX_THREADS) {
    let owner = owner_of(p);
    let rect = rects[first_rank + owner];
    let columns = (rect >> 16u) & 255u;
    let nth = p - select(ends[max(owner, 1u) - 1u], 0u, owner == 0u);
    let bin = vec2u((rect & 255u) + nth % columns, ((rect >> 8u) & 255u) + nth / columns);
    bins[base + p] = bin.y * view.bins.x + bin.x;
    pairs[base + p] = order[first_rank + owner];
  }
}
