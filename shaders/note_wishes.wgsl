// Which pages of a streamed scene the view asks for, or will ask for when they have come, whether they are there or not: those of chunks that are off by
// more than is allowed. One thread for each chunk; not in every frame.
#import shared/chunk_visibility
#import shared/detail
#import shared/group

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> chunks: array<Chunk>;
@group(0) @binding(2) var<storage, read> details: array<ChunkDetail>;
@group(0) @binding(3) var<storage, read> chunk_shares: array<f32>;
// For each streamed page the bits of the pixels that doing without it costs, or 0. The first page is always there: in its place the most that the view lacks.
@group(0) @binding(4) var<storage, read_write> wishes: array<atomic<u32>>;
// Where the camera will be: the columns of `local_to_camera`, and the eye.
@group(0) @binding(5) var<uniform> ahead: array<vec4f, 5>;

const WISH_THREADS = 64u;
// How much less a page out of view is wished for, within a picture that is NEARBY_SIZE times as wide and high and beyond: a camera that turns, or that goes elsewhere than was
// thought, finds it there.
const NEARBY = 0.25;
const NEARBY_SIZE = 2.0;
const UNSEEN = 0.0625;

// Share of the pixels that are allowed from which on a page is wished for, though nothing of it is drawn yet: the view lacks it soon.
const SOON = 0.93;

// Share of the pixels that a budget allows down to which a page that is there is still wished for. A page that comes takes of the budget, so more is allowed: with one bound it would
// be wished for no more, leave, and be wished for again. Half an octave is four of the steps in which a budget is found.
const KEPT = 0.7;

// Pixels that doing without what is finer costs a view, from so many of them on.
fn wish_of(seen: View, chunk: Chunk, d: ChunkDetail, allowed: f32, least: f32) -> f32 {
  let pixels = screen_error(seen, d.sphere, d.full_error);
  if (pixels <= least && refined(pixels, allowed, seen.detail_fade) == 0u) { return 0.0; }
  if (may_be_visible(seen, chunk)) { return pixels; }
  return select(UNSEEN, NEARBY, may_be_visible(nearby(seen), chunk)) * pixels;
}

// The view with a wider picture around the same middle.
fn nearby(seen: View) -> View {
  var wider = seen;
  wider.viewport *= NEARBY_SIZE;
  wider.principal += 0.5 * (NEARBY_SIZE - 1.0) * seen.viewport;
  return wider;
}

@compute @workgroup_size(WISH_THREADS)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let chunk = group_index(workgroup_id) * WISH_THREADS + lane;
  if (chunk * CULL_GROUP >= view.splat_count) { return; }
  let d = details[chunk];
  let page = d.children & CHILD_PAGE_MASK;
  if (page >= arrayLength(&wishes)) { return; }
  var later = view;
  later.local_to_camera = mat4x4f(ahead[0], ahead[1], ahead[2], ahead[3]);
  later.eye = ahead[4].xyz;
  let allowed = max(view.detail, chunk_shares[arrayLength(&chunk_shares) - 1u]);
  let is_kept = d.error > 0.0 && allowed > view.detail;
  let bound = select(allowed, max(view.detail, KEPT * allowed), is_kept);
  let soon = SOON * bound;
  let wish = max(wish_of(view, chunks[chunk], d, bound, soon), wish_of(later, chunks[chunk], d, bound, soon));
  if (wish > 0.0) { atomicMax(&wishes[page], bitcast<u32>(wish)); }
  if (d.error > 0.0) { return; }
  let now = wish_of(view, chunks[chunk], d, allowed, allowed);
  if (now > 0.0) { atomicMax(&wishes[0], bitcast<u32>(now)); }
}
