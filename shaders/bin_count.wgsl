// Counts the bins that each splat touches: one thread for each splat, in depth order; also sums each group of 256.
#import shared/bins
#import shared/coverage
#import shared/plan
#import shared/group
#import shared/prefix

@group(0) @binding(0) var<uniform> view: BinView;
@group(0) @binding(1) var<storage, read> plan: Plan;
@group(0) @binding(2) var<storage, read> splats: array<ProjectedSplat>;
@group(0) @binding(3) var<storage, read> order: array<u32>;
// Bins of each splat: first column, first row, columns, rows, one byte each.
@group(0) @binding(4) var<storage, read_write> rects: array<u32>;
@group(0) @binding(5) var<storage, read_write> group_pairs: array<u32>;

fn bin_rect(s: ProjectedSplat) -> u32 {
  let c = coverage_of(s);
  let size = bin_size(view);
  // Only pixel centers count, which are half a pixel inside the edges.
  let low = clamp(c.center - c.extent - 0.5, vec2f(0.0), view.viewport - 1.0);
  let high = clamp(c.center + c.extent + 0.5, vec2f(0.0), view.viewport - 1.0);
  // Clamped after rounding, because a bin outside the image would be written over the ranges of other bins.
  let first = min(vec2u(low / size), view.bins - 1u);
  let count = clamp(vec2u(high / size), first, view.bins - 1u) - first + 1u;
  return first.x | (first.y << 8u) | (count.x << 16u) | (count.y << 24u);
}

@compute @workgroup_size(PREFIX_THREADS)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let group = group_index(workgroup_id);
  if (group * PREFIX_THREADS >= plan.visible) {
    if (lane == 0u && group < view.splat_groups) { group_pairs[group] = 0u; }
    return;
  }
  let rank = group * PREFIX_THREADS + lane;
  var pairs = 0u;
  if (rank < plan.visible) {
    let rect = bin_rect(splats[order[rank]]);
    rects[rank] = rect;
    pairs = ((rect >> 16u) & 255u) * (rect >> 24u);
  }
  let sum = inclusive_sum(pairs, lane, PREFIX_THREADS);
  if (lane == PREFIX_THREADS - 1u) { group_pairs[group] = sum; }
}
