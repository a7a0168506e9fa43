// Records which pages of a streamed scene the view needs, resident or not, now or once their parents have arrived:
// those below chunks whose error exceeds the threshold. One thread for each chunk; does not run in every frame.
#import shared/chunk_visibility
#import shared/detail
#import shared/group

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> chunks: array<Chunk>;
@group(0) @binding(2) var<storage, read> details: array<ChunkDetail>;
@group(0) @binding(3) var<storage, read> chunk_shares: array<f32>;
// For each streamed page the error in pixels of a missing page, as float32 bits, or 0. The first page is always
// resident: its entry holds the largest error of the view.
@group(0) @binding(4) var<storage, read_write> requests: array<atomic<u32>>;
// The predicted camera, in the coordinates of the camera: the columns of the matrix to it, and its eye.
@group(0) @binding(5) var<uniform> ahead: array<vec4f, 5>;

const FEEDBACK_THREADS = 64u;
// Factors of the error of pages outside the view: NEARBY within an image NEARBY_SIZE times as wide and high, UNSEEN
// beyond. A camera that turns or moves unexpectedly then finds them resident.
const NEARBY = 0.25;
const NEARBY_SIZE = 2.0;
const UNSEEN = 0.0625;

// A page is already requested at this fraction of the error threshold, because the view will need it soon.
const SOON = 0.93;

// A resident page is still requested down to this fraction of the budget's error threshold. A new page uses part of the
// budget, which raises the threshold: with a single bound it would be dropped, evicted and requested again. Half an
// octave is four of the steps that find the threshold.
const KEPT = 0.7;

// Screen error of a missing page in pixels, or 0 if it is at most `threshold`.
fn page_error(seen: View, chunk: Chunk, d: ChunkDetail, allowed: f32, threshold: f32) -> f32 {
  let pixels = screen_error(seen, d.sphere, d.full_error);
  if (pixels <= threshold && refined(pixels, allowed, seen.detail_fade) == 0u) { return 0.0; }
  if (may_be_visible(seen, chunk)) { return pixels; }
  return select(UNSEEN, NEARBY, may_be_visible(nearby(seen), chunk)) * pixels;
}

// The view of the predicted camera.
fn predicted(seen: View) -> View {
  var later = seen;
  // Cramer's rule, because a placement may scale and shear. The division keeps products in the range of float32.
  let x = seen.local_to_camera[0].xyz / seen.stretch;
  let y = seen.local_to_camera[1].xyz / seen.stretch;
  let z = seen.local_to_camera[2].xyz / seen.stretch;
  let eye = ahead[4].xyz / seen.stretch;
  later.eye += vec3f(dot(eye, cross(y, z)), dot(eye, cross(z, x)), dot(eye, cross(x, y))) / dot(x, cross(y, z));
  later.local_to_camera = mat4x4f(ahead[0], ahead[1], ahead[2], ahead[3]) * seen.local_to_camera;
  return later;
}

// The view with a wider image around the same center.
fn nearby(seen: View) -> View {
  var wider = seen;
  wider.viewport *= NEARBY_SIZE;
  wider.principal += 0.5 * (NEARBY_SIZE - 1.0) * seen.viewport;
  return wider;
}

@compute @workgroup_size(FEEDBACK_THREADS)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let chunk = group_index(workgroup_id) * FEEDBACK_THREADS + lane;
  if (chunk * CULL_GROUP >= view.splat_count) { return; }
  let d = details[chunk];
  let page = d.children & CHILD_PAGE_MASK;
  if (page >= arrayLength(&requests)) { return; }
  let later = predicted(view);
  let allowed = max(view.detail, chunk_shares[arrayLength(&chunk_shares) - 1u]);
  let is_kept = d.error > 0.0 && allowed > view.detail;
  let bound = select(allowed, max(view.detail, KEPT * allowed), is_kept);
  let soon = SOON * bound;
  let request = max(page_error(view, chunks[chunk], d, bound, soon), page_error(later, chunks[chunk], d, bound, soon));
  if (request > 0.0) { atomicMax(&requests[page], bitcast<u32>(request)); }
  if (d.error > 0.0) { return; }
  let now = page_error(view, chunks[chunk], d, allowed, allowed);
  if (now > 0.0) { atomicMax(&requests[0], bitcast<u32>(now)); }
}
