// How many splats of each block of an order are visible.
#import shared/thin

@group(0) @binding(3) var<storage, read_write> block_counts: array<u32>;

@compute @workgroup_size(PREFIX_THREADS)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  var own = 0u;
  let start = run_start(workgroup_id, lane);
  for (var word = start; word < start + THIN_RUN / 4u; word++) {
    if (4u * word < thin.length) {
      let flags = visible_flags(order[word]);
      own += flags.x + flags.y + flags.z + flags.w;
    }
  }
  let sum = inclusive_sum(own, lane, PREFIX_THREADS);
  let block_id = group_index(workgroup_id);
  if (lane == PREFIX_THREADS - 1u && block_id * THIN_BLOCK < thin.length) { block_counts[block_id] = sum; }
}
