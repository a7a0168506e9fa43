// Draws splats back to front as quads.
#import shared/quad
#import shared/plan

@group(0) @binding(0) var<uniform> raster: RasterView;
@group(0) @binding(1) var<storage, read> plan: Plan;
@group(0) @binding(2) var<storage, read> splats: array<ProjectedSplat>;
// Slots from near to far.
@group(0) @binding(3) var<storage, read> order: array<u32>;

struct RasterView {
  // Pixels.
  viewport: vec2f,
  // Slice of the splats to draw, counted from the farthest, and the number of slices.
  slice: u32,
  slices: u32,
}

const NO_SLOT = 0xffffffffu;

// Slot of the splat of a vertex, or NO_SLOT if there is none.
fn slot_of(vertex_index: u32, instance: u32) -> u32 {
  let rank = instance * QUAD_BATCH + vertex_index / 4u;
  let share = (plan.visible + raster.slices - 1u) / raster.slices;
  if (rank >= plan.visible || rank / share != raster.slice) { return NO_SLOT; }
  return order[plan.visible - 1u - rank];
}
