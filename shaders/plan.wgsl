// Turns the counts of `scan` into the indirect arguments of the stages that follow. One thread: a few dozen words.
#import shared/plan
#import shared/group

@group(0) @binding(0) var<uniform> limits: PlanLimits;
// Exclusive prefix sums of the survivors of each cull group, and behind the last group the total.
@group(0) @binding(1) var<storage, read> group_offsets: array<u32>;
// First cull group of each page; one more entry than there are pages.
@group(0) @binding(2) var<storage, read> page_groups: array<u32>;
@group(0) @binding(3) var<storage, read_write> plan: Plan;

struct PlanLimits {
  page_count: u32,
  // Splats that the renderer's buffers have room for.
  capacity: u32,
}

const INDICES_PER_QUAD = 6u;

@compute @workgroup_size(1)
fn main() {
  let total = group_offsets[page_groups[limits.page_count]];
  let visible = min(total, limits.capacity);
  plan.visible = visible;
  plan.overflow = total - visible;

  plan.sort_blocks = (visible + SORT_BLOCK - 1u) / SORT_BLOCK;
  let sort_grid = dispatch_grid(visible, SORT_BLOCK);
  plan.sort_x = sort_grid.x;
  plan.sort_y = sort_grid.y;
  plan.sort_z = 1u;

  let visible_grid = dispatch_grid(visible, PROJECT_GROUP);
  plan.visible_x = visible_grid.x;
  plan.visible_y = visible_grid.y;
  plan.visible_z = 1u;

  plan.quad_indices = QUAD_BATCH * INDICES_PER_QUAD;
  plan.quad_instances = (visible + QUAD_BATCH - 1u) / QUAD_BATCH;
  plan.quad_first_index = 0u;
  plan.quad_base_vertex = 0u;
  plan.quad_first_instance = 0u;

  for (var page = 0u; page < limits.page_count; page++) {
    let first = min(group_offsets[page_groups[page]], visible);
    let end = min(group_offsets[page_groups[page + 1u]], visible);
    let project_grid = dispatch_grid(end - first, PROJECT_GROUP);
    plan.pages[page] = PagePlan(first, end - first, project_grid.x, project_grid.y, 1u);
  }
}
