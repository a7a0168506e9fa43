// Counts and indirect arguments of the pairs, in the same struct as those of the splats, so that the same sort serves both.
#import shared/bins
#import shared/plan
#import shared/group

@group(0) @binding(0) var<uniform> view: BinView;
// Exclusive prefix sums, and behind the last the total.
@group(0) @binding(1) var<storage, read> group_pairs: array<u32>;
@group(0) @binding(2) var<storage, read_write> pair_plan: Plan;

@compute @workgroup_size(1)
fn main() {
  let total = group_pairs[arrayLength(&group_pairs) - 1u];
  let pairs = min(total, view.pair_capacity);
  pair_plan.visible = pairs;
  pair_plan.overflow = total - pairs;
  pair_plan.sort_blocks = (pairs + SORT_BLOCK - 1u) / SORT_BLOCK;
  let sort_grid = dispatch_grid(pairs, SORT_BLOCK);
  pair_plan.sort_x = sort_grid.x;
  pair_plan.sort_y = sort_grid.y;
  pair_plan.sort_z = 1u;
  let pair_grid = dispatch_grid(pairs, PROJECT_GROUP);
  pair_plan.visible_x = pair_grid.x;
  pair_plan.visible_y = pair_grid.y;
  pair_plan.visible_z = 1u;
}
