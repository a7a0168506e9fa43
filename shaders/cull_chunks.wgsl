// Finds the LOD weight of each chunk of a block, one thread each. The weight is 0 if the chunk holds no visible splat,
// or is coarser or finer than the view requires.
#import shared/chunk_visibility
#import shared/detail
#import shared/group

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> chunks: array<Chunk>;
// Cleared here, as are the bits of chunks that are not drawn.
@group(0) @binding(2) var<storage, read_write> group_counts: array<u32>;
@group(0) @binding(3) var<storage, read_write> visible_bits: array<u32>;
// Used by blocks that have levels of detail.
@group(0) @binding(4) var<storage, read> details: array<ChunkDetail>;
// The last word belongs to no chunk: it is the error threshold in pixels that a splat budget requires.
@group(0) @binding(5) var<storage, read_write> chunk_shares: array<f32>;

const CHUNK_THREADS = 64u;
fn share_of(chunk: u32) -> f32 {
  if (view.has_detail == 0u) { return 1.0; }
  return share_drawn(view, details[chunk], max(view.detail, chunk_shares[arrayLength(&chunk_shares) - 1u]));
}

@compute @workgroup_size(CHUNK_THREADS)
fn main(@builtin(global_invocation_id) id: vec3u) {
  let chunk = id.x;
  if (chunk * CULL_GROUP >= view.splat_count) { return; }
  let group = view.first_group + chunk;
  group_counts[group] = 0u;
  var share = share_of(chunk);
  if (share <= 0.0 || !may_be_visible(view, chunks[chunk])) {
    share = 0.0;
    for (var w = 0u; w < WORDS_PER_GROUP; w++) { visible_bits[group * WORDS_PER_GROUP + w] = 0u; }
  }
  chunk_shares[group] = share;
}
