// Turns the counts of `scan` into the indirect arguments of the stages that follow. One thread: a few dozen words.
#import shared/plan
#import shared/group

@group(0) @binding(0) var<uniform> limits: PlanLimits;
// Exclusive prefix sums of the survivors of each group, or of each block of an order, and behind the last the total.
@group(0) @binding(1) var<storage, read> offsets: array<u32>;
// For each page the first of its offsets and the one behind its last.
@group(0) @binding(2) var<storage, read> page_ranges: array<vec2u>;
@group(0) @binding(3) var<storage, read_write> plan: Plan;

struct PlanLimits {
  page_count: u32,
  // Splats that the renderer's buffers have room for.
  capacity: u32,
  // Where in `offsets` the total lies.
  total_at: u32,
}

const INDICES_PER_QUAD = 6u;

@compute @workgroup_size(1)
fn main() {
  let total = offsets[limits.total_at];
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
    let first = min(offsets[page_ranges[page].x], visible);
    let end = min(offsets[page_ranges[page].y], visible);
    let project_grid = dispatch_grid(end - first, PROJECT_GROUP);
    plan.pages[page] = PagePlan(first, end - first, project_grid.x, project_grid.y, 1u);
  }
}
