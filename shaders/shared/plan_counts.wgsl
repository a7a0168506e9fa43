// Writes the counts for the stages after `cull` from the prefix sums.
#import shared/plan
#import shared/group

@group(0) @binding(1) var<uniform> limits: PlanLimits;
// For each block the index of its first sum and the index after its last.
@group(0) @binding(2) var<storage, read> page_ranges: array<vec2u>;
@group(0) @binding(3) var<storage, read_write> plan: Plan;

struct PlanLimits {
  page_count: u32,
  // Capacity of the renderer's buffers in splats.
  capacity: u32,
  // Number of counts: groups of splats, or blocks of the sort.
  length: u32,
}

// One thread suffices for a few dozen words.
fn write_plan() {
  let total = value_at(limits.length);
  let visible = min(total, limits.capacity);
  plan.visible = visible;
  plan.overflow = total - visible;
  plan.sort_blocks = (visible + SORT_BLOCK - 1u) / SORT_BLOCK;
  for (var page = 0u; page < limits.page_count; page++) {
    let first = min(value_at(page_ranges[page].x), visible);
    let end = min(value_at(page_ranges[page].y), visible);
    plan.pages[page] = PagePlan(first, end - first);
  }
}
