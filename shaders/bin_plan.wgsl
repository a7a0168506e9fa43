// Sums the pairs of each group of splats and writes their count into the same struct as that of the splats, so that the
// same sort serves both; also clears the bins.
#import shared/scan
#import shared/bins
#import shared/plan

@group(0) @binding(1) var<uniform> view: BinView;
@group(0) @binding(2) var<storage, read_write> pair_plan: Plan;
@group(0) @binding(3) var<storage, read_write> ranges: array<vec2u>;

@compute @workgroup_size(PREFIX_THREADS)
fn main(@builtin(local_invocation_index) lane: u32) {
  for (var bin = lane; bin < view.bins.x * view.bins.y; bin += PREFIX_THREADS) { ranges[bin] = vec2u(0u); }
  scan_values(view.splat_groups, lane);
  if (lane != 0u) { return; }
  let total = value_at(view.splat_groups);
  let pairs = min(total, view.pair_capacity);
  pair_plan.visible = pairs;
  pair_plan.overflow = total - pairs;
  pair_plan.sort_blocks = (pairs + SORT_BLOCK - 1u) / SORT_BLOCK;
}
