// Draws splats back to front as quads just large enough for alpha >= 1/255. The fragment evaluates the Gaussian at the
// pixel centre from flat inputs, so nothing is interpolated and the maths is that of any other rasterizer.
#import shared/splat
#import shared/falloff
#import shared/plan

@group(0) @binding(0) var<uniform> raster: RasterView;
@group(0) @binding(1) var<storage, read> plan: Plan;
@group(0) @binding(2) var<storage, read> splats: array<ProjectedSplat>;
// Slots from near to far.
@group(0) @binding(3) var<storage, read> order: array<u32>;

struct RasterView {
  // Pixels.
  viewport: vec2f,
  // Which part of the splats to draw, counted from the farthest, of how many.
  slice: u32,
  slices: u32,
}

// Pixels by which quads are larger than they need be: rasterizers snap vertices, some of them to 1/16 of a pixel, and the quad of a
// splat whose opacity is just above ALPHA_MIN may be smaller than that.
const SNAP_MARGIN = 0.0625;
const NO_SLOT = 0xffffffffu;
// Quads that reach farther than this, in pixels, are drawn as their box clipped to the image instead.
const MAX_REACH = 8192.0;

fn quad_corner(s: ProjectedSplat, opacity: f32, corner: vec2f) -> vec2f {
  let sigma_x = 1.0 / s.shape.z;
  let slope = s.shape.w;
  let sigma_v = 1.0 / bitcast<f32>(s.paint.x);
  let radius = cutoff_radius(opacity);
  let half_width = radius * sigma_x + SNAP_MARGIN;
  let half_height = radius * sqrt(slope * slope * sigma_x * sigma_x + sigma_v * sigma_v) + SNAP_MARGIN;
  if (max(half_width, half_height) > MAX_REACH) {
    let box = s.shape.xy + corner * vec2f(half_width, half_height);
    return clamp(box, vec2f(-1.0), raster.viewport + 1.0);
  }
  // The square around the circle of that radius in (u, v): as tight as a rectangle along the ellipse's axes.
  let dx = corner.x * half_width;
  return s.shape.xy + vec2f(dx, slope * dx + corner.y * (radius * sigma_v + SNAP_MARGIN * (1.0 + abs(slope))));
}

// Slot of the splat that a vertex belongs to; NO_SLOT where there is none.
fn slot_of(vertex_index: u32, instance: u32) -> u32 {
  let rank = instance * QUAD_BATCH + vertex_index / 4u;
  let share = (plan.visible + raster.slices - 1u) / raster.slices;
  if (rank >= plan.visible || rank / share != raster.slice) { return NO_SLOT; }
  return order[plan.visible - 1u - rank];
}

// Where a vertex of a splat's quad lies.
fn place_of(s: ProjectedSplat, vertex_index: u32) -> vec4f {
  let corner = vec2f(f32(vertex_index & 1u), f32((vertex_index >> 1u) & 1u)) * 2.0 - 1.0;
  let pixel = quad_corner(s, bitcast<f32>(s.paint.w), corner);
  return vec4f((pixel / raster.viewport * 2.0 - 1.0) * vec2f(1.0, -1.0), 0.0, 1.0);
}
