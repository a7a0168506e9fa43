// For the survivors of a page: how their depth differs from pixel to pixel; and other depth keys. Runs between `project` and the sort.
#import shared/projection
#import shared/stored_gaussian
#import shared/gathered
#import shared/plan
#import shared/group
#import shared/pixel_depth

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> gaussians: array<StoredGaussian>;
@group(0) @binding(2) var<storage, read> survivors: array<u32>;
@group(0) @binding(3) var<storage, read> plan: Plan;
@group(0) @binding(4) var<storage, read> gathered: array<u32>;
// By slot.
@group(0) @binding(5) var<storage, read_write> pixel_depths: array<PixelDepth>;
@group(0) @binding(6) var<storage, read_write> keys: array<u32>;

// Standard deviations of its depth over the screen by which a splat is listed before its centre: one that comes too late for a pixel's window
// is blended too late, one that comes too early waits in it.
const AHEAD = 0.5;

struct Found {
  depth: PixelDepth,
  key_depth: f32,
}

fn pixel_depth_of(g: Gaussian) -> Found {
  var p = in_camera(view, g.position);
  p.z = max(p.z, view.near);
  let is_parallel = view.is_orthographic != 0u;
  let shrink = select(p.z, 1.0, is_parallel);
  let t = select(p.xy / p.z, vec2f(0.0), is_parallel);
  let to_camera = mat3x3f(view.local_to_camera[0].xyz, view.local_to_camera[1].xyz, view.local_to_camera[2].xyz);
  let axes = mat3x3f(
    to_camera * g.factor_x,
    to_camera[1] * g.factor_y.x + to_camera[2] * g.factor_y.y,
    to_camera[2] * g.factor_z,
  );
  // Pixels across and down of the splat's own axes, seen along the ray through its centre, and how deep they go.
  let a = transpose(axes);
  let row_x = (a[0] - t.x * a[2]) * (view.focal.x / shrink);
  let row_y = (a[1] - t.y * a[2]) * (view.focal.y / shrink);
  let row_z = a[2];

  // Depth by x, and by what y has besides: as the ellipse is taken apart (shared/ellipse), so that needles keep their digits.
  let variance_x = dot(row_x, row_x) + view.filter_variance;
  let by_x = dot(row_z, row_x) / variance_x;
  let lean = dot(row_x, row_y) / variance_x;
  let minors = cross(row_x * inverseSqrt(variance_x), row_y);
  let variance_v = dot(minors, minors) + view.filter_variance * (variance_x + dot(row_y, row_y)) / variance_x;
  let by_v = dot(row_z, row_y - lean * row_x) / max(variance_v, 1e-30);
  let by_pixel = vec2f(by_x - by_v * lean, by_v);
  let spread = by_x * by_x * variance_x + by_v * by_v * variance_v;
  let along_ray = max(dot(row_z, row_z) - spread, 0.0);

  var depth = PixelDepth(by_pixel, p.z, 0.0);
  if (!is_parallel) { depth = PixelDepth(-by_pixel / (p.z * p.z), 1.0 / p.z, along_ray / (p.z * p.z)); }
  return Found(depth, p.z - AHEAD * sqrt(spread));
}

// As `depth_key` of `project`, of depths that may lie before the nearest centre.
fn ahead_key(depth: f32) -> u32 {
  let depth_bits = bitcast<u32>(max(depth, 0.0));
  if (view.key_bits == 32u) { return depth_bits; }
  let margin = MARGIN_OCTAVES << OCTAVE_BITS;
  let nearest = max(~gathered[NEAREST_INVERTED], margin) - margin;
  let range = f32(max(gathered[FARTHEST] - nearest, 1u));
  let share = f32(max(depth_bits, nearest) - nearest) / range;
  return u32(min(share, 1.0) * f32((1u << view.key_bits) - 1u));
}

@compute @workgroup_size(PROJECT_GROUP)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let page = plan.pages[view.page];
  let rank = group_index(workgroup_id) * PROJECT_GROUP + lane;
  if (rank >= page.survivors) { return; }
  let slot = page.first_slot + rank;
  let found = pixel_depth_of(unpack_gaussian(gaussian_at(survivors[slot] - view.first_group * CULL_GROUP)));
  pixel_depths[slot] = found.depth;
  keys[slot] = ahead_key(found.key_depth);
}
