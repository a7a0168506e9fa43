// Which pages of a streamed scene the view asks for, whether they are there or not: those of chunks that are off by more than is
// allowed. One thread for each chunk; not in every frame.
#import shared/chunk_visibility
#import shared/detail
#import shared/group

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> chunks: array<Chunk>;
@group(0) @binding(2) var<storage, read> details: array<ChunkDetail>;
@group(0) @binding(3) var<storage, read> chunk_shares: array<f32>;
// For each streamed page the bits of the pixels that doing without it costs, or 0.
@group(0) @binding(4) var<storage, read_write> wishes: array<atomic<u32>>;

const WISH_THREADS = 64u;
// How much less a page out of view is wished for: a camera that turns finds it there.
const UNSEEN = 0.125;

@compute @workgroup_size(WISH_THREADS)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let chunk = group_index(workgroup_id) * WISH_THREADS + lane;
  if (chunk * CULL_GROUP >= view.splat_count) { return; }
  let d = details[chunk];
  let page = d.children & CHILD_PAGE_MASK;
  if (page >= arrayLength(&wishes)) { return; }
  let allowed = max(view.detail, chunk_shares[arrayLength(&chunk_shares) - 1u]);
  let pixels = screen_error(view, d.sphere, d.full_error);
  if (refined(pixels, allowed, view.detail_fade) == 0u) { return; }
  let wish = select(UNSEEN * pixels, pixels, may_be_visible(view, chunks[chunk]));
  atomicMax(&wishes[page], bitcast<u32>(wish));
}
