// Counts, for a splat budget, the splats that would be drawn at each error threshold. One thread for each chunk; each
// workgroup adds its sums to memory once.
#import shared/chunk_visibility
#import shared/detail
#import shared/detail_counts
#import shared/group

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> chunks: array<Chunk>;
@group(0) @binding(2) var<storage, read> details: array<ChunkDetail>;
@group(0) @binding(3) var<storage, read_write> detail_counts: array<atomic<u32>>;

const DETAIL_THREADS = 256u;

var<workgroup> own_counts: array<atomic<u32>, DETAIL_COUNTS>;

@compute @workgroup_size(DETAIL_THREADS)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let chunk = group_index(workgroup_id) * DETAIL_THREADS + lane;
  if (chunk * CULL_GROUP < view.splat_count) { count_chunk(chunk); }
  workgroupBarrier();
  for (var k = lane; k < DETAIL_COUNTS; k += DETAIL_THREADS) {
    let count = atomicLoad(&own_counts[k]);
    if (count > 0u) { atomicAdd(&detail_counts[k], count); }
  }
}

fn count_chunk(chunk: u32) {
  // A chunk without levels is drawn at every threshold.
  var own = 0.0;
  var above = 1e30;
  if (view.has_detail != 0u) {
    let d = details[chunk];
    // While finer chunks fade in, both levels are drawn.
    if (arrived_below(d) == ARRIVAL_STEPS) { own = screen_error(view, d.sphere, d.full_error); }
    above = screen_error(view, d.parent_sphere, d.parent_error) * exp2(view.detail_fade);
  }
  // Empty slots of a streamed scene have no parent.
  if (own > above || above <= 0.0 || !may_be_visible(view, chunks[chunk])) { return; }
  let splats = min(CULL_GROUP, view.splat_count - chunk * CULL_GROUP);
  atomicAdd(&own_counts[bucket_of(own)], splats);
  atomicAdd(&own_counts[DETAIL_BUCKETS + bucket_of(above)], splats);
}
