// Which chunks of a page may hold visible splats: one thread for each chunk. The tests are linear in camera space, so that
// the corners of a box decide for all its points, and err only towards keeping.
#import shared/view
#import shared/chunk
#import shared/group

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> chunks: array<Chunk>;
// Chunks to look into, in no particular order, from the page's first group on.
@group(0) @binding(2) var<storage, read_write> chunk_list: array<u32>;
// Indirect arguments of `cull` and `compact` for each page, three words; the first counts the chunks.
@group(0) @binding(3) var<storage, read_write> chunk_args: array<atomic<u32>>;
// Set to nothing.
@group(0) @binding(4) var<storage, read_write> group_counts: array<u32>;
@group(0) @binding(5) var<storage, read_write> visible_bits: array<u32>;

const CHUNK_THREADS = 64u;
// Pixels that dilation can add to a splat's half extent (sqrt(0.3 · 2 ln 255) = 1.83), and one for rounding.
const MARGIN = 3.0;

// Least value of normal · (camera-space point) over the box.
fn least(center: vec3f, half_size: vec3f, normal: vec3f) -> f32 {
  let local = vec3f(
    dot(view.local_to_camera[0].xyz, normal), dot(view.local_to_camera[1].xyz, normal), dot(view.local_to_camera[2].xyz, normal),
  );
  let middle = dot(local, center) + dot(view.local_to_camera[3].xyz, normal);
  let slack = 1e-5 * (dot(abs(local), abs(center)) + abs(dot(view.local_to_camera[3].xyz, normal)));
  return middle - dot(abs(local), half_size) - slack;
}

fn may_be_visible(c: Chunk) -> bool {
  let center = 0.5 * (c.low + c.high);
  let half_size = 0.5 * (c.high - c.low);
  if (least(center, half_size, vec3f(0.0, 0.0, -1.0)) > -view.near) { return false; }
  if (least(center, half_size, vec3f(0.0, 0.0, 1.0)) > view.far) { return false; }
  // The Jacobian stretches a splat by at most focal / z · sqrt(1 + t²): times z, that does not depend on the point.
  let t = max(abs(view.jacobian_min), abs(view.jacobian_max));
  let reach = 1.001 * c.reach * view.stretch * view.focal * sqrt(1.0 + t * t);
  let right = view.principal.x - view.viewport.x - MARGIN;
  let bottom = view.principal.y - view.viewport.y - MARGIN;
  return least(center, half_size, vec3f(view.focal.x, 0.0, right)) <= reach.x
    && least(center, half_size, vec3f(-view.focal.x, 0.0, -view.principal.x - MARGIN)) <= reach.x
    && least(center, half_size, vec3f(0.0, view.focal.y, bottom)) <= reach.y
    && least(center, half_size, vec3f(0.0, -view.focal.y, -view.principal.y - MARGIN)) <= reach.y;
}

@compute @workgroup_size(CHUNK_THREADS)
fn main(@builtin(global_invocation_id) id: vec3u) {
  let chunk = id.x;
  if (chunk * CULL_GROUP >= view.splat_count) { return; }
  let group = view.first_group + chunk;
  group_counts[group] = 0u;
  if (may_be_visible(chunks[chunk])) {
    chunk_list[view.first_group + atomicAdd(&chunk_args[3u * view.page], 1u)] = chunk;
  } else {
    for (var w = 0u; w < WORDS_PER_GROUP; w++) { visible_bits[group * WORDS_PER_GROUP + w] = 0u; }
  }
}
