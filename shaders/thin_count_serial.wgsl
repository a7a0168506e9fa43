// `thin_count` for processors that run few threads one after the other: a thread counts a whole block.
#import shared/thin_order

@group(0) @binding(3) var<storage, read_write> block_counts: array<u32>;

@compute @workgroup_size(BLOCKS_PER_SERIAL_GROUP)
fn main(@builtin(workgroup_id) workgroup_id: vec3u, @builtin(local_invocation_index) lane: u32) {
  let block_id = group_index(workgroup_id) * BLOCKS_PER_SERIAL_GROUP + lane;
  let start = block_id * THIN_BLOCK / 4u;
  let end = min(start + THIN_BLOCK / 4u, thin.length / 4u);
  if (start >= end) { return; }
  var sum = vec4u(0u);
  for (var word = start; word < end; word++) { sum += visible_flags(order[word]); }
  block_counts[block_id] = sum.x + sum.y + sum.z + sum.w;
}
